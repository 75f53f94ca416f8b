"""A stand with a fork in which a broom's stick leans upright."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, add_box

STEEL = (0.36, 0.38, 0.42, 1.0)
RUBBER = (0.16, 0.16, 0.17, 1.0)

POLE_Y_M = 0.085
POLE_RADIUS_M = 0.012
FOOT_RADIUS_M = 0.055
FOOT_HALF_HEIGHT_M = 0.006
PRONG_HALF_M = (0.004, 0.045, 0.012)
PRONG_Y_M = 0.030
BAR_HALF_M = (0.022, 0.008, 0.012)
BAR_Y_M = 0.073
TIP_HALF_LENGTH_M = 0.006

CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER


@dataclass(frozen=True)
class BroomStand:
    """A static pole with a fork that is open towards -y; its frame lies under the fork, where the broom stands.

    Attributes:
        name: body.
        fork_height_m: of the fork's middle above the table.
        gap_m: between the prongs.
    """

    name: str = "stand"
    fork_height_m: float = 0.235
    gap_m: float = 0.028

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write foot, pole and fork, and rubber tips for the eye."""
        body = spec.worldbody.add_body(name=self.name)
        z, half_height = self.fork_height_m, (self.fork_height_m + PRONG_HALF_M[2]) / 2
        foot = (FOOT_RADIUS_M, FOOT_HALF_HEIGHT_M, 0)
        body.add_geom(type=CYLINDER, pos=(0, POLE_Y_M, FOOT_HALF_HEIGHT_M), size=foot, rgba=RUBBER)
        pole = (POLE_RADIUS_M, half_height, 0)
        body.add_geom(type=CYLINDER, pos=(0, POLE_Y_M, half_height), size=pole, rgba=STEEL)
        add_box(body, (0, BAR_Y_M, z), BAR_HALF_M, rgba=STEEL)
        half_x, half_y, half_z = PRONG_HALF_M
        for side in (-1, 1):
            x = side * (self.gap_m / 2 + half_x)
            add_box(body, (x, PRONG_Y_M, z), PRONG_HALF_M, rgba=STEEL)
            add_box(
                body,
                (x, PRONG_Y_M - half_y + TIP_HALF_LENGTH_M, z),
                (half_x + 0.0008, TIP_HALF_LENGTH_M, half_z + 0.0008),
                rgba=RUBBER,
                **VISUAL_ONLY,
            )
