"""A narrow fridge with two doors, of which the upper one opens."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import (
    HINGE,
    ON_RUBBER,
    SLIDE,
    add_box,
    add_capsule,
    add_joint,
    add_visual_box,
)

SHELL = (0.84, 0.87, 0.90, 1.0)
DOOR = (0.90, 0.92, 0.94, 1.0)
LINER = (0.97, 0.98, 1.00, 1.0)
SHELF = (0.70, 0.82, 0.88, 1.0)
SEAL = (0.45, 0.47, 0.50, 1.0)
METAL = (0.30, 0.30, 0.33, 1.0)
LAMP = (1.00, 0.97, 0.85, 1.0)
BADGE = (0.12, 0.34, 0.62, 1.0)
LAMP_EMISSION = 0.9
LINER_EMISSION = 0.25

HALF_DEPTH_M, HALF_WIDTH_M, HEIGHT_M = 0.122, 0.172, 0.955
WALL_HALF_M = 0.006
COMPARTMENT_FLOOR_M = 0.380
"""Upper side of the board that parts the two compartments."""
SHELF_M = 0.679
SHELF_HALF_M = 0.004
SHELF_FRICTION = (0.6, 0.005, 0.0001)

# Of the doors, in the fridge's frame: +x goes inside, the hinge is at the edge on the side of -y.
DOOR_HALF_THICKNESS_M = 0.010
DOOR_GAP_M = 0.004
LOWER_DOOR_M = (0.005, 0.368)
UPPER_DOOR_M = (0.376, 0.952)
"""Lower and upper edge."""
DOOR_MASS_KG = 0.8
HINGE_RANGE_RAD = 2.0
HINGE_FRICTION_NM = 0.052
"""As in the original."""
HINGE_DAMPING_NM_S = 0.1
CLOSING_NM = 0.6
"""Torque of the closing spring at a door that is shut; it grows by a quarter until the door is wide open."""
SPRING_NM_RAD = 0.075

HANDLE_FROM_HINGE_M = 0.318
HANDLE_STAND_OFF_M = 0.05
"""Between bar and door: room for two fingers, also where they come at an angle."""
HANDLE_M = (0.464, 0.784)
LOWER_HANDLE_M = (0.08, 0.30)
HANDLE_RADIUS_M = 0.0075
HANDLE_GIVES_M = 0.012
"""How far it gives along the door, on rubber."""
POST_RADIUS_M = 0.006


@dataclass(frozen=True)
class Fridge:
    """A fridge that stands still. Its frame lies on the table, under its middle, x pointing in and y to the handle.

    Attributes:
        name: body; also the prefix of the upper door (`..._door`) and its hinge (`..._hinge`).
    """

    front_m: ClassVar[float] = -HALF_DEPTH_M
    """The plane of the opening: its x in the fridge's frame."""

    name: str = "fridge"

    @property
    def compartment(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lower and upper corner of the room under the upper compartment's shelf, in the fridge's frame, m."""
        x, y = HALF_DEPTH_M - 2 * WALL_HALF_M, HALF_WIDTH_M - 2 * WALL_HALF_M
        return (-HALF_DEPTH_M, -y, COMPARTMENT_FLOOR_M - 0.002), (x, y, SHELF_M - SHELF_HALF_M)

    def handle(self, door_rad: float, height_m: float) -> NDArray[np.float64]:
        """(3,) point of the upper door's bar when the door is open by `door_rad`, in the fridge's frame, m."""
        (x, y), cos, sin = _HINGE_M, np.cos(door_rad), np.sin(door_rad)
        ahead, aside = _HANDLE_X_M, HANDLE_FROM_HINGE_M
        return np.array((x + cos * ahead - sin * aside, y + sin * ahead + cos * aside, height_m))

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the shell with its closed lower door, and the upper door."""
        for part, rgba, emission in (("lamp", LAMP, LAMP_EMISSION), ("liner", LINER, LINER_EMISSION)):
            spec.add_material(name=f"{self.name}_{part}", rgba=rgba, emission=emission)
        body = spec.worldbody.add_body(name=self.name)
        self._add_shell(body)
        self._add_lower_door(body)
        self._add_upper_door(body)
        spec.add_exclude(bodyname1=self.name, bodyname2=f"{self.name}_door")

    def _add_shell(self, body) -> None:
        x, y, z, wall = HALF_DEPTH_M, HALF_WIDTH_M, HEIGHT_M / 2, WALL_HALF_M
        add_box(body, (x - wall, 0, z), (wall, y, z), rgba=SHELL)
        for side in (-1, 1):
            add_box(body, (0, side * (y - wall), z), (x, wall, z), rgba=SHELL)
            add_box(body, (0, 0, z + side * (z - wall)), (x, y, wall), rgba=SHELL)
        floor = COMPARTMENT_FLOOR_M - wall
        for middle, half, rgba in (
            ((-wall, 0, floor), (x - wall, y - 2 * wall, wall), LINER),  # ends at the back wall
            ((0, 0, SHELF_M), (x - 0.020, y - 2 * wall, SHELF_HALF_M), SHELF),
        ):
            add_box(body, middle, half, rgba=rgba, friction=SHELF_FRICTION, solref=(0.005, 1))
        self._line(body)

    def _line(self, body) -> None:
        """Bright sheets inside the upper compartment and a lamp under its ceiling."""
        x, y, sheet = HALF_DEPTH_M - 2 * WALL_HALF_M, HALF_WIDTH_M - 2 * WALL_HALF_M, 0.0005
        middle, half = (COMPARTMENT_FLOOR_M + HEIGHT_M) / 2, (HEIGHT_M - COMPARTMENT_FLOOR_M) / 2 - 0.013
        liner = f"{self.name}_liner"
        add_visual_box(body, (x, 0, middle), (sheet, y, half), material=liner)
        for side in (-y, y):
            add_visual_box(body, (0.006, side, middle), (HALF_DEPTH_M - 0.014, sheet, half), material=liner)
        add_visual_box(body, (0.02, 0, HEIGHT_M - 0.018), (0.03, 0.05, 0.006), material=f"{self.name}_lamp")

    def _add_lower_door(self, body) -> None:
        low, high = LOWER_DOOR_M
        front = -HALF_DEPTH_M - DOOR_GAP_M - 2 * DOOR_HALF_THICKNESS_M
        half = (DOOR_HALF_THICKNESS_M, HALF_WIDTH_M - 0.002, (high - low) / 2)
        add_box(body, (front + DOOR_HALF_THICKNESS_M, 0, (low + high) / 2), half, rgba=DOOR)
        _add_handle(body, front, HANDLE_FROM_HINGE_M - HALF_WIDTH_M, LOWER_HANDLE_M)

    def _add_upper_door(self, body) -> None:
        low, high = UPPER_DOOR_M
        middle, half_height = (low + high) / 2, (high - low) / 2
        width, thickness = HALF_WIDTH_M, DOOR_HALF_THICKNESS_M
        door = body.add_body(name=f"{self.name}_door", pos=(*_HINGE_M, 0))
        spring = {"stiffness": SPRING_NM_RAD, "springref": -CLOSING_NM / SPRING_NM_RAD}
        brake = (HINGE_FRICTION_NM, HINGE_DAMPING_NM_S)
        add_joint(door, HINGE, f"{self.name}_hinge", (0, 0, 1), (0, HINGE_RANGE_RAD), *brake, **spring)
        half = (thickness, width - 0.002, half_height)
        add_box(door, (-thickness, width, middle), half, mass=DOOR_MASS_KG, rgba=DOOR)
        handle = door.add_body(name=f"{self.name}_handle")
        travel_m = (-HANDLE_GIVES_M, HANDLE_GIVES_M)
        add_joint(handle, SLIDE, f"{self.name}_rubber", (0, 1, 0), travel_m, **ON_RUBBER)
        _add_handle(handle, -2 * thickness, HANDLE_FROM_HINGE_M, HANDLE_M, mass=0.03)
        # Inside: the dark seal around a bright panel with two racks. Outside: the maker's badge.
        for inset, proud, rgba in ((0.010, 0.0020, SEAL), (0.026, 0.0025, LINER)):
            add_visual_box(door, (0, width, middle), (proud, width - inset, half_height - inset), rgba=rgba)
        for height in (low + 0.06, low + 0.32):
            for rise, depth, half_rise in ((0.0, 0.016, 0.003), (0.03, 0.002, 0.012)):
                rack = (depth, width - 0.040, half_rise)
                add_visual_box(door, (0.032 - depth, width, height + rise), rack, rgba=SHELF)
        add_visual_box(door, (-2 * thickness, 0.07, high - 0.05), (0.001, 0.03, 0.008), rgba=BADGE)


_HINGE_M = (-HALF_DEPTH_M - DOOR_GAP_M, -HALF_WIDTH_M)
_HANDLE_X_M = -2 * DOOR_HALF_THICKNESS_M - HANDLE_STAND_OFF_M
"""Position of the bar, in the door's frame."""


def _add_handle(body, front_m: float, y_m: float, span_m: tuple[float, float], mass: float = 0.0) -> None:
    """A round upright bar on two posts before the plane x = `front_m`."""
    low, high = span_m
    x = front_m - HANDLE_STAND_OFF_M
    for radius, start, end in (
        (HANDLE_RADIUS_M, (x, y_m, low), (x, y_m, high)),
        (POST_RADIUS_M, (x, y_m, low), (front_m, y_m, low)),
        (POST_RADIUS_M, (x, y_m, high), (front_m, y_m, high)),
    ):
        add_capsule(body, (*start, *end), radius, mass=mass, rgba=METAL)
