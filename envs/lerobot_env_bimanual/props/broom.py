"""A hand broom, and a stand with a fork in which its stick leans upright."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop

WOOD = (0.80, 0.62, 0.38, 1.0)
PAINT = (0.78, 0.20, 0.16, 1.0)
STRAW = ((0.93, 0.84, 0.52, 1.0), (0.86, 0.75, 0.42, 1.0))

STICK_HALF_WIDTH_M = 0.0085
HEAD_HALF_M = (0.125, 0.019, 0.014)
HEAD_Z_M = 0.040
BRISTLE_HALF_DEPTH_M = 0.021
BRISTLE_REACH_M = 0.010
"""How far the collision shape of the bristles reaches below them: they sweep at any height and tilt of the hand."""
WING_HALF_M = (0.003, 0.014)
"""Outermost bristles, swept forward, which keep dirt from escaping sideways; half sizes along x and y."""
FOOT_RADIUS_M = 0.006
FOOT_STIFFNESS, FOOT_DAMPING = 800, 30
TUFTS = 15

STICK_MASS_KG, HEAD_MASS_KG, BRISTLE_MASS_KG, WING_MASS_KG, FOOT_MASS_KG = 0.06, 0.10, 0.02, 0.005, 0.01

STEEL = (0.36, 0.38, 0.42, 1.0)
RUBBER = (0.16, 0.16, 0.17, 1.0)
POLE_Y_M = 0.085
POLE_RADIUS_M = 0.012
STAND_RADIUS_M = 0.055
STAND_HALF_HEIGHT_M = 0.006
FORK_Z_M, FORK_GAP_M = 0.235, 0.028
PRONG_HALF_M = (0.004, 0.045, 0.012)
PRONG_Y_M = 0.030
BAR_HALF_M = (0.022, 0.008, 0.012)
BAR_Y_M = 0.073
TIP_HALF_LENGTH_M = 0.006
"""The stand's pole and foot, its fork with two prongs, the bar that joins them, and their rubber tips."""


@dataclass(frozen=True)
class Broom:
    """A free broom, its frame under the stick where the bristles end; it sweeps towards -y.

    Bristles collide with dirt only, since real bristles bend: as a solid block they would catch on the pan's lip and
    tilt the broom. Two frictionless, yielding feet, which collide with the table only, carry the broom instead.

    Attributes:
        name: body.
        height_m: to the upper end of the stick.
    """

    name: str = "broom"
    height_m: float = 0.35

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write stick and head, the collision shapes of bristles and feet, and the visible tufts."""
        body = prop.add_free_body(spec, self.name)
        self._add_stick(body)
        prop.add_box(body, (0, 0, HEAD_Z_M), HEAD_HALF_M, mass=HEAD_MASS_KG, rgba=PAINT)
        self._add_bristles(body)
        self._add_feet(body)
        self._add_tufts(body)

    def _add_stick(self, body) -> None:
        """Add a square bar for collisions, whose sides a gripper holds firmly, and a round one for images."""
        half, bottom = STICK_HALF_WIDTH_M, HEAD_Z_M
        middle, half_length = (self.height_m + bottom) / 2, (self.height_m - bottom) / 2
        prop.add_box(
            body, (0, 0, middle), (half, half, half_length), mass=STICK_MASS_KG, **prop.COLLISION_ONLY
        )
        prop.add_cylinder(body, (0, 0, middle), half, half_length, rgba=WOOD, **prop.VISUAL_ONLY)
        prop.add_sphere(body, (0, 0, self.height_m), half, rgba=PAINT, **prop.VISUAL_ONLY)
        socket = 1.6 * half
        socket_z = HEAD_Z_M + HEAD_HALF_M[2] + socket / 2
        prop.add_cylinder(body, (0, 0, socket_z), socket, socket / 2, rgba=PAINT, **prop.VISUAL_ONLY)

    def _add_bristles(self, body) -> None:
        half_x, _, head_half_z = HEAD_HALF_M
        top = HEAD_Z_M - head_half_z
        z, half_z = (top - BRISTLE_REACH_M) / 2, (top + BRISTLE_REACH_M) / 2
        sweeping = {"solref": (0.004, 1), "contype": prop.DIRT_ONLY, "conaffinity": 0, **prop.COLLISION_ONLY}
        block = (half_x, BRISTLE_HALF_DEPTH_M, half_z)
        prop.add_box(body, (0, 0, z), block, mass=BRISTLE_MASS_KG, **sweeping)
        wing_x, wing_y = WING_HALF_M
        for side in (-1, 1):
            place = (side * (half_x - wing_x), -BRISTLE_HALF_DEPTH_M - wing_y, z)
            prop.add_box(body, place, (wing_x, wing_y, half_z), mass=WING_MASS_KG, **sweeping)

    def _add_feet(self, body) -> None:
        half_x, half_y, _ = HEAD_HALF_M
        # Without friction (condim 1): with the table's the broom trails behind the hand.
        contact = {"condim": 1, "priority": 2, "solref": (-FOOT_STIFFNESS, -FOOT_DAMPING)}
        gliding = {"contype": prop.TABLE_ONLY, "conaffinity": 0, **contact, **prop.COLLISION_ONLY}
        for side in (-1, 1):
            x, y, z = side * (half_x - FOOT_RADIUS_M), half_y - FOOT_RADIUS_M, FOOT_RADIUS_M
            prop.add_capsule(body, (x, -y, z, x, y, z), FOOT_RADIUS_M, mass=FOOT_MASS_KG, **gliding)

    def _add_tufts(self, body) -> None:
        """Straw in two shades, spread a little like a fan, and the wings."""
        half_x, _, head_half_z = HEAD_HALF_M
        half_z = (HEAD_Z_M - head_half_z) / 2
        spacing = 2 * half_x / TUFTS
        for tuft in range(TUFTS):
            share = (tuft - (TUFTS - 1) / 2) / (TUFTS / 2)
            angle = -0.12 * share
            straw = (0.52 * spacing, BRISTLE_HALF_DEPTH_M, half_z)
            turned = (np.cos(angle / 2), 0, np.sin(angle / 2), 0)
            prop.add_visual_box(body, (share * half_x, 0, half_z), straw, quat=turned, rgba=STRAW[tuft % 2])
        wing_x, wing_y = WING_HALF_M
        for side in (-1, 1):
            place = (side * (half_x - wing_x), -BRISTLE_HALF_DEPTH_M - wing_y, half_z)
            prop.add_visual_box(body, place, (wing_x, wing_y, half_z), rgba=STRAW[1])


@dataclass(frozen=True)
class BroomStand:
    """A static pole with a fork that is open towards -y; its frame lies under the fork, where the broom stands.

    Attributes:
        name: body.
    """

    name: str = "stand"

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write foot, pole and fork, and rubber tips for the eye."""
        body = spec.worldbody.add_body(name=self.name)
        z, half_height = FORK_Z_M, (FORK_Z_M + PRONG_HALF_M[2]) / 2
        foot_z = STAND_HALF_HEIGHT_M
        prop.add_cylinder(body, (0, POLE_Y_M, foot_z), STAND_RADIUS_M, STAND_HALF_HEIGHT_M, rgba=RUBBER)
        prop.add_cylinder(body, (0, POLE_Y_M, half_height), POLE_RADIUS_M, half_height, rgba=STEEL)
        prop.add_box(body, (0, BAR_Y_M, z), BAR_HALF_M, rgba=STEEL)
        half_x, half_y, half_z = PRONG_HALF_M
        for side in (-1, 1):
            x = side * (FORK_GAP_M / 2 + half_x)
            prop.add_box(body, (x, PRONG_Y_M, z), PRONG_HALF_M, rgba=STEEL)
            tip = (half_x + 0.0008, TIP_HALF_LENGTH_M, half_z + 0.0008)
            prop.add_visual_box(body, (x, PRONG_Y_M - half_y + TIP_HALF_LENGTH_M, z), tip, rgba=RUBBER)
