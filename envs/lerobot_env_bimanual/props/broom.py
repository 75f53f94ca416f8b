"""A hand broom."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import DIRT_ONLY, TABLE_ONLY, VISUAL_ONLY, add_box, add_cylinder

WOOD = (0.80, 0.62, 0.38, 1.0)
PAINT = (0.78, 0.20, 0.16, 1.0)
STRAW = ((0.93, 0.84, 0.52, 1.0), (0.86, 0.75, 0.42, 1.0))

STICK_HALF_WIDTH_M = 0.0085
HEAD_HALF_M = (0.125, 0.019, 0.014)
HEAD_Z_M = 0.040
BRISTLE_HALF_DEPTH_M = 0.017
BRISTLE_REACH_M = 0.010
"""How far below the table the bristles are felt: they sweep, whatever the height and tilt of the hand."""
WING_HALF_M = (0.003, 0.014)
"""Outermost bristles, swept forward, which keep dirt from escaping sideways; half sizes along x and y."""
FOOT_RADIUS_M = 0.006
FOOT_STIFFNESS, FOOT_DAMPING = 800, 30
TUFTS = 15

STICK_MASS_KG, HEAD_MASS_KG, BRISTLE_MASS_KG, WING_MASS_KG, FOOT_MASS_KG = 0.06, 0.10, 0.02, 0.005, 0.01

HIDDEN_GROUP = 3
CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


@dataclass(frozen=True)
class Broom:
    """A free broom, its frame under the stick where the bristles end; it sweeps towards -y.

    Bristles touch dirt and nothing else, as bristles bend: with a solid block the broom catches on the pan's lip
    and tilts. Two frictionless, yielding feet, which touch the table alone, carry it in their place.

    Attributes:
        name: body.
        height_m: to the upper end of the stick.
    """

    name: str = "broom"
    height_m: float = 0.35

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write stick and head, the bristles and feet as they are felt, and the tufts as they are seen."""
        body = spec.worldbody.add_body(name=self.name)
        body.add_freejoint()
        self._add_stick(body)
        add_box(body, (0, 0, HEAD_Z_M), HEAD_HALF_M, mass=HEAD_MASS_KG, rgba=PAINT)
        self._add_bristles(body)
        self._add_feet(body)
        self._add_tufts(body)

    def _add_stick(self, body) -> None:
        """Felt as a square bar, whose sides a gripper holds firmly; seen as a round one."""
        half, bottom = STICK_HALF_WIDTH_M, HEAD_Z_M
        middle, half_length = (self.height_m + bottom) / 2, (self.height_m - bottom) / 2
        add_box(body, (0, 0, middle), (half, half, half_length), mass=STICK_MASS_KG, group=HIDDEN_GROUP)
        add_cylinder(body, (0, 0, middle), half, half_length, rgba=WOOD, **VISUAL_ONLY)
        body.add_geom(type=SPHERE, pos=(0, 0, self.height_m), size=(half, 0, 0), rgba=PAINT, **VISUAL_ONLY)
        socket = 1.6 * half
        add_cylinder(
            body,
            (0, 0, HEAD_Z_M + HEAD_HALF_M[2] + socket / 2),
            socket,
            socket / 2,
            rgba=PAINT,
            **VISUAL_ONLY,
        )

    def _add_bristles(self, body) -> None:
        half_x, _, head_half_z = HEAD_HALF_M
        top = HEAD_Z_M - head_half_z
        z, half_z = (top - BRISTLE_REACH_M) / 2, (top + BRISTLE_REACH_M) / 2
        block = (half_x, BRISTLE_HALF_DEPTH_M, half_z)
        self._add_sweeping(body, (0, 0, z), block, BRISTLE_MASS_KG)
        wing_x, wing_y = WING_HALF_M
        for side in (-1, 1):
            place = (side * (half_x - wing_x), -BRISTLE_HALF_DEPTH_M - wing_y, z)
            self._add_sweeping(body, place, (wing_x, wing_y, half_z), WING_MASS_KG)

    def _add_sweeping(self, body, position, size, mass: float) -> None:
        add_box(
            body,
            position,
            size,
            mass=mass,
            solref=(0.004, 1),
            contype=DIRT_ONLY,
            conaffinity=0,
            group=HIDDEN_GROUP,
        )

    def _add_feet(self, body) -> None:
        half_x, half_y, _ = HEAD_HALF_M
        for side in (-1, 1):
            x, y, z = side * (half_x - FOOT_RADIUS_M), half_y - FOOT_RADIUS_M, FOOT_RADIUS_M
            body.add_geom(
                type=CAPSULE,
                size=(FOOT_RADIUS_M, 0, 0),
                fromto=(x, -y, z, x, y, z),
                mass=FOOT_MASS_KG,
                condim=1,  # without friction; with the table's the broom trails behind the hand
                priority=2,
                solref=(-FOOT_STIFFNESS, -FOOT_DAMPING),
                contype=TABLE_ONLY,
                conaffinity=0,
                group=HIDDEN_GROUP,
            )

    def _add_tufts(self, body) -> None:
        """Straw in two shades, spread a little like a fan, and the wings."""
        half_x, _, head_half_z = HEAD_HALF_M
        half_z = (HEAD_Z_M - head_half_z) / 2
        spacing = 2 * half_x / TUFTS
        for tuft in range(TUFTS):
            share = (tuft - (TUFTS - 1) / 2) / (TUFTS / 2)
            angle = -0.12 * share
            add_box(
                body,
                (share * half_x, 0, half_z),
                (0.52 * spacing, BRISTLE_HALF_DEPTH_M, half_z),
                quat=(np.cos(angle / 2), 0, np.sin(angle / 2), 0),
                rgba=STRAW[tuft % 2],
                **VISUAL_ONLY,
            )
        wing_x, wing_y = WING_HALF_M
        for side in (-1, 1):
            place = (side * (half_x - wing_x), -BRISTLE_HALF_DEPTH_M - wing_y, half_z)
            add_box(body, place, (wing_x, wing_y, half_z), rgba=STRAW[1], **VISUAL_ONLY)
