"""A light dustpan with an upright handle, which glides, and the crumbs of dirt that it is for."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop

BLUE = (0.20, 0.45, 0.75, 1.0)
DARK_BLUE = (0.14, 0.34, 0.60, 1.0)
RUBBER = (0.13, 0.14, 0.16, 1.0)
WOOD = (0.80, 0.62, 0.38, 1.0)

FLOOR_HALF_M = (0.152, 0.080, 0.001)
FLOOR_Y_M = -0.005
LIP_HALF_M = (0.152, 0.016, 0.0008)
LIP_SLOPE_RAD = np.deg2rad(15.0)
LIP_CREST_M = 0.0085
"""Height of the lip's upper end, over which dirt falls onto the floor."""
SIDE_HALF_M = (0.003, 0.085, 0.022)
BACK_HALF_M = (0.156, 0.003, 0.030)
BACK_Y_M = -0.088
SOCKET_HALF_M = (0.020, 0.012, 0.012)
HANDLE_RADIUS_M = 0.0105
HANDLE_BOTTOM_M = 0.020
RIBS = 5
FIRM = (0.006, 1.0)
"""Contact of the sides, which a broom may strike."""
GAP_M = 0.002
"""Height of everything but the gliders above the table."""
GLIDER_RADIUS_M = 0.002
GLIDER_FRICTION = 0.1
"""Sliding on the table: that of hard, smooth plastic. It takes 0.08 N to move the pan."""

# Thin plastic, and a hollow handle: 0.08 kg in all.
FLOOR_MASS_KG, LIP_MASS_KG, SIDE_MASS_KG, BACK_MASS_KG = 0.035, 0.004, 0.006, 0.008
HANDLE_MASS_KG, SOCKET_MASS_KG, GLIDER_MASS_KG = 0.014, 0.003, 0.001

EARTH = (0.26, 0.16, 0.08, 1.0)
DRAWS = 100
"""How often a place is drawn for crumbs."""
SLIDING_FRICTION = 0.5
ROLLING_FRICTION_M = 0.003
"""Of a crumb. Large for a ball of this size: it only starts to roll on a slope of 11 degrees."""


@dataclass(frozen=True)
class Dustpan:
    """A free pan, open towards +y, its frame in the middle of the underside.

    Attributes:
        name: body.
        handle_y_m: where the handle stands, in the pan's axes.
        height_m: to the upper end of the handle.
    """

    name: str = "dustpan"
    handle_y_m: float = -0.10
    height_m: float = 0.36

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write floor, lip, walls and handle, and ribs and grip for the eye."""
        body = prop.add_free_body(spec, self.name)
        floor = (0, FLOOR_Y_M, GAP_M + FLOOR_HALF_M[2])
        prop.add_box(body, floor, FLOOR_HALF_M, mass=FLOOR_MASS_KG, rgba=BLUE)
        self._add_gliders(body)
        self._add_lip(body)
        for side in (-1, 1):
            place = (side * (FLOOR_HALF_M[0] + 0.001), 0, GAP_M + SIDE_HALF_M[2])
            prop.add_box(body, place, SIDE_HALF_M, mass=SIDE_MASS_KG, rgba=BLUE, solref=FIRM)
        back = (0, BACK_Y_M, GAP_M + BACK_HALF_M[2])
        prop.add_box(body, back, BACK_HALF_M, mass=BACK_MASS_KG, rgba=BLUE)
        socket = (0, self.handle_y_m + 0.005, 0.018)
        prop.add_box(body, socket, SOCKET_HALF_M, mass=SOCKET_MASS_KG, rgba=BLUE)
        self._add_handle(body)
        self._add_ribs(body)

    def _add_lip(self, body) -> None:
        """A ramp from the table up to a crest at the floor's edge, which only dirt notices."""
        half_y, half_z = LIP_HALF_M[1:]
        along, up = np.cos(LIP_SLOPE_RAD), np.sin(LIP_SLOPE_RAD)
        y = FLOOR_Y_M + FLOOR_HALF_M[1] + half_y * along
        place = (0, y, LIP_CREST_M - half_y * up - half_z * along)
        turned = (np.cos(LIP_SLOPE_RAD / 2), -np.sin(LIP_SLOPE_RAD / 2), 0, 0)
        contact = {"mass": LIP_MASS_KG, "contype": prop.DIRT_ONLY, "conaffinity": 0}
        prop.add_box(body, place, LIP_HALF_M, quat=turned, rgba=BLUE, **contact)

    def _add_gliders(self, body) -> None:
        """Add round feet under the floor: four points of contact, which are computed quickly."""
        contact = {"friction": (GLIDER_FRICTION, 0.005, 0.0001), "priority": 1}
        gliding = {"contype": prop.TABLE_ONLY, "conaffinity": 0, **contact, **prop.COLLISION_ONLY}
        for side_x, side_y in product((-1, 1), repeat=2):
            x, y = side_x * 0.9 * FLOOR_HALF_M[0], FLOOR_Y_M + side_y * 0.9 * FLOOR_HALF_M[1]
            prop.add_sphere(body, (x, y, GLIDER_RADIUS_M), GLIDER_RADIUS_M, mass=GLIDER_MASS_KG, **gliding)

    def _add_handle(self, body) -> None:
        """Add a capsule: with a cylinder, some contacts with fingers would get lost now and then, and the pan would jerk."""
        y, top = self.handle_y_m, self.height_m
        prop.add_capsule(
            body, (0, y, HANDLE_BOTTOM_M, 0, y, top), HANDLE_RADIUS_M, mass=HANDLE_MASS_KG, rgba=WOOD
        )
        prop.add_sphere(body, (0, y, top), 1.02 * HANDLE_RADIUS_M, rgba=RUBBER, **prop.VISUAL_ONLY)

    def _add_ribs(self, body) -> None:
        """Grooves along the floor."""
        half_x, half_y, half_z = FLOOR_HALF_M
        for x in np.linspace(-0.75, 0.75, RIBS) * half_x:
            place = (x, FLOOR_Y_M, GAP_M + 2 * half_z)
            prop.add_visual_box(body, place, (0.003, 0.9 * half_y, 0.0003), rgba=DARK_BLUE)


@dataclass(frozen=True)
class Crumb:
    """A free lump of earth, its frame in the middle: a ball that hardly rolls, whose contacts are computed quickly.

    Attributes:
        name: body.
        radius_m: of the ball.
        mass_kg: that of dry earth; the original's half milligram is too light to simulate.
    """

    name: str
    radius_m: float = 0.019
    mass_kg: float = 0.015

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the ball."""
        body = prop.add_free_body(spec, self.name)
        friction = (SLIDING_FRICTION, 0.005, ROLLING_FRICTION_M)
        contact = {"friction": friction, "condim": 6, "solref": (0.004, 1)}
        layers = {"contype": prop.COMMON_LAYER, "conaffinity": prop.COMMON_LAYER | prop.DIRT_ONLY}
        prop.add_sphere(body, (0, 0, 0), self.radius_m, mass=self.mass_kg, rgba=EARTH, **contact, **layers)


def scattered(
    rng: np.random.Generator, middles_m: NDArray[np.float64], half_m: NDArray[np.float64], distance_m: float
) -> list[NDArray[np.float64]] | None:
    """Draw a position (2,) near each middle (n, 2) for a crumb; None if some crumb cannot be placed apart from the others.

    Args:
        rng: drawn from.
        middles_m: (n, 2) in the axes in which the places are wanted.
        half_m: (2,) how far from its middle a crumb may lie along x and y.
        distance_m: least distance of two crumbs.
    """
    spots: list[NDArray[np.float64]] = []
    for offset in rng.uniform(-1.0, 1.0, (DRAWS, 2)) * half_m:
        spot = middles_m[len(spots)] + offset
        if all(np.linalg.norm(spot - other) >= distance_m for other in spots):
            spots.append(spot)
        if len(spots) == len(middles_m):
            return spots
    return None
