"""A beach ball too wide for one gripper."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import add_free_body, add_sphere

GORE_COLORS = np.array(
    [(232, 64, 60), (250, 250, 250), (255, 196, 46), (250, 250, 250), (48, 112, 210), (250, 250, 250)],
    dtype=np.float64,
)
CAP_COLOR = np.array((250, 250, 250), dtype=np.float64)
CAP_HALF_ANGLE_RAD = np.deg2rad(16)
TEXTURE_FACE_PIXELS = 96
SAMPLES_PER_PIXEL_SIDE = 2


@dataclass(frozen=True)
class Ball:
    """A free ball, its frame in the centre.

    Attributes:
        name: body and geom.
        radius_m: of the paper's large ball.
        mass_kg: the paper's.
        friction: against everything, hands and table included. Low, so that a grip off the ball's middle line
            slips instead of lifting it by luck.
    """

    name: str = "ball"
    radius_m: float = 0.15
    mass_kg: float = 1.0
    friction: float = 0.3

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the ball and its print."""
        kind, side = mujoco.mjtTexture.mjTEXTURE_CUBE, TEXTURE_FACE_PIXELS
        texture = spec.add_texture(name=self.name, type=kind, width=side, height=6 * side, nchannel=3)
        texture.data = beach_ball_texture().tobytes()
        material = spec.add_material(name=self.name, specular=0.3, shininess=0.4)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = self.name
        body = add_free_body(spec, self.name)
        contact = {"friction": (self.friction, 0.01, 0.001), "condim": 4, "priority": 2}
        spring = {"solref": (0.008, 1), "solimp": (0.9, 0.95, 0.002, 0.5, 2)}
        ball = {"name": self.name, "mass": self.mass_kg, "material": self.name}
        add_sphere(body, (0, 0, 0), self.radius_m, **ball, **contact, **spring)


def beach_ball_texture() -> NDArray[np.uint8]:
    """Cube map (6, n, n, 3): coloured gores about the x axis under white caps.

    The faces follow OpenGL's order and orientation: +x, -x, +y, -y, +z, -z.
    """
    side = TEXTURE_FACE_PIXELS * SAMPLES_PER_PIXEL_SIDE
    across = (np.arange(side) + 0.5) / side * 2 - 1
    s, t = np.meshgrid(across, across)  # column, row
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    direction = np.array(faces).transpose(0, 2, 3, 1)  # (6, side, side, 3)
    x, y, z = np.moveaxis(direction / np.linalg.norm(direction, axis=-1, keepdims=True), -1, 0)
    turns = np.arctan2(z, y) / (2 * np.pi)  # noqa: TID251 (it is only seen)
    gore = np.floor(turns * len(GORE_COLORS)).astype(int) % len(GORE_COLORS)
    color = np.where(np.abs(x)[..., None] > np.cos(CAP_HALF_ANGLE_RAD), CAP_COLOR, GORE_COLORS[gore])
    n, k = TEXTURE_FACE_PIXELS, SAMPLES_PER_PIXEL_SIDE
    return color.reshape(6, n, k, n, k, 3).mean(axis=(2, 4)).round().astype(np.uint8)
