"""A small glass bottle."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.meshes import add_mesh, add_visual_mesh, lathe
from lerobot_env_bimanual.props.prop import (
    COLLISION_ONLY,
    add_capsule,
    add_cylinder,
    add_free_body,
    graspable,
)

GLASS = (0.13, 0.45, 0.24, 1.0)
PAPER = (0.96, 0.94, 0.86, 1.0)
CAP = (0.90, 0.78, 0.18, 1.0)

BODY_HEIGHT_M = 0.102
NECK_RADIUS_M, NECK_BOTTOM_M = 0.0064, 0.118
SHOULDER_RADIUS_M = 0.012
CAP_RADIUS_M, CAP_BOTTOM_M, HEIGHT_M = 0.0080, 0.142, 0.154
EDGE_M = 0.002
LABEL_M = (0.030, 0.068)
"""Lower and upper edge of the paper around the body."""
LABEL_PROUD_M = 0.0003
BODY_MASS_SHARE, SHOULDER_MASS_SHARE, NECK_MASS_SHARE = 0.86, 0.07, 0.07


@dataclass(frozen=True)
class Bottle:
    """A free bottle, its frame in the middle of the underside. Its visual shapes are turned meshes.

    Its collision shapes are cylinders and, where fingers grip it, a capsule: MuJoCo now and then misplaces a contact between
    a cylinder and a finger's flat pad for one step, and the light bottle would jerk.

    Attributes:
        name: body.
        mass_kg: of PerAct2's bottle, whose sizes are used, too.
        friction: against everything but the grippers' rubber.
        radius_m: of the body below the shoulder.
    """

    name: str = "bottle"
    mass_kg: float = 0.112
    friction: float = 0.8
    radius_m: float = 0.0178

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the collision shapes, then glass, label and cap."""
        body = add_free_body(spec, self.name)
        contact = {**graspable(self.friction), **COLLISION_ONLY}
        ends = (0, 0, self.radius_m, 0, 0, BODY_HEIGHT_M - SHOULDER_RADIUS_M)
        add_capsule(body, ends, self.radius_m, mass=BODY_MASS_SHARE * self.mass_kg, **contact)
        for radius, bottom, top, share in (
            (self.radius_m, 0, self.radius_m, 0.0),  # its foot
            (SHOULDER_RADIUS_M, BODY_HEIGHT_M, NECK_BOTTOM_M, SHOULDER_MASS_SHARE),
            (CAP_RADIUS_M, NECK_BOTTOM_M, HEIGHT_M, NECK_MASS_SHARE),
        ):
            middle, half_height = (bottom + top) / 2, (top - bottom) / 2
            add_cylinder(body, (0, 0, middle), radius, half_height, mass=share * self.mass_kg, **contact)
        paper = self.radius_m + LABEL_PROUD_M
        low, high = LABEL_M
        glass = [
            (0, 0),
            (self.radius_m - EDGE_M, 0),
            (self.radius_m, EDGE_M),
            (self.radius_m, BODY_HEIGHT_M - EDGE_M),
            (self.radius_m - EDGE_M, BODY_HEIGHT_M + EDGE_M),
            (SHOULDER_RADIUS_M, BODY_HEIGHT_M + 4 * EDGE_M),
            (NECK_RADIUS_M, NECK_BOTTOM_M),
            (NECK_RADIUS_M, CAP_BOTTOM_M),
            (0, CAP_BOTTOM_M),
        ]
        label = [(0, low), (paper, low), (paper, high), (0, high)]
        cap = [(0, CAP_BOTTOM_M), (CAP_RADIUS_M, CAP_BOTTOM_M), (CAP_RADIUS_M, HEIGHT_M), (0, HEIGHT_M)]
        for part, profile, rgba in (("glass", glass, GLASS), ("label", label, PAPER), ("cap", cap, CAP)):
            mesh = f"{self.name}_{part}"
            add_mesh(spec, mesh, lathe(profile))
            add_visual_mesh(body, mesh, rgba=rgba)
