"""A low block, placed at any height by sinking it into the table, with posts or walls that leave a hand one way in."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import add_box, add_capsule, add_visual_box

SLATE = (0.34, 0.38, 0.44, 1.0)
EDGE = (0.80, 0.82, 0.85, 1.0)
BRASS = (0.80, 0.62, 0.26, 1.0)
BAND_HALF_HEIGHT_M = 0.002
PROUD_M = 0.0005
POST_RADIUS_M = 0.006


@dataclass(frozen=True)
class Pedestal:
    """A static block, its frame in the middle of its top.

    Attributes:
        name: body and geom.
        size_m: full sizes of the top along x and y.
        depth_m: from the top down; as high as it can be placed above the table.
        posts_m: x, y and height of upright posts beside the block, in its frame.
        walls_m: x and y of the middle, full sizes along x and y, and height of walls beside it.
    """

    name: str = "pedestal"
    size_m: tuple[float, float] = (0.10, 0.10)
    depth_m: float = 0.06
    posts_m: tuple[tuple[float, float, float], ...] = ()
    walls_m: tuple[tuple[float, float, float, float, float], ...] = ()

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the block, a light band around its top, and the posts."""
        body = spec.worldbody.add_body(name=self.name)
        x, y, z = self.size_m[0] / 2, self.size_m[1] / 2, self.depth_m / 2
        add_box(body, (0, 0, -z), (x, y, z), name=self.name, rgba=SLATE, friction=(0.5, 0.005, 0.0001))
        band = (x + PROUD_M, y + PROUD_M, BAND_HALF_HEIGHT_M)
        add_visual_box(body, (0, 0, -BAND_HALF_HEIGHT_M - PROUD_M), band, rgba=EDGE)
        for post_x, post_y, top in self.posts_m:
            ends = (post_x, post_y, -self.depth_m, post_x, post_y, top)
            add_capsule(body, ends, POST_RADIUS_M, rgba=BRASS)
        for wall_x, wall_y, size_x, size_y, top in self.walls_m:
            half = (size_x / 2, size_y / 2, (top + self.depth_m) / 2)
            add_box(body, (wall_x, wall_y, top - half[2]), half, rgba=BRASS)
