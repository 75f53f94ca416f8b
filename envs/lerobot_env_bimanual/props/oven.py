"""An oven with a door that tips open and a rack that slides out."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop

STEEL = (0.80, 0.81, 0.83, 1.0)
DARK = (0.17, 0.17, 0.19, 1.0)
GLASS = (0.05, 0.05, 0.07, 1.0)
ENAMEL = (0.34, 0.35, 0.40, 1.0)
LAMP = (1.00, 0.90, 0.65, 1.0)
DISPLAY = (0.25, 0.85, 0.60, 1.0)
WIRE = (0.66, 0.66, 0.68, 1.0)
METAL = (0.88, 0.88, 0.90, 1.0)
LINER_EMISSION = 0.25
LAMP_EMISSION = 0.9

# In the oven's frame, which lies on the table under its middle; +x goes inside, +y to the left of who looks in.
HALF_DEPTH_M, HALF_WIDTH_M, HEIGHT_M = 0.192, 0.275, 0.600
FLOOR_M, CEILING_M = 0.1025, 0.455
"""Size of the cavity (decoded from RLBench's task file)."""
WALL_HALF_M = 0.010
BACK_HALF_M = 0.006
FOOT_HEIGHT_M = 0.012
FOOT_RADIUS_M = 0.018
FOOT_INSET_M = (0.06, 0.05)

HINGE_BEFORE_FRONT_M = 0.006
DOOR_HALF_M = (0.006, 0.274, 0.172)
DOOR_LIFT_M = 0.002
DOOR_MASS_KG = 0.8
DOOR_RANGE_RAD = 1.55
DOOR_FRICTION_NM = 0.15
"""Brake of the hinge."""
DOOR_DAMPING_NM_S = 3.0
"""A door let go of at half its way sinks to the end in about a second."""
HANDLE_Z_M = 0.2935
"""Above the hinge."""
HANDLE_STAND_OFF_M = 0.05
"""Between bar and door: room for two fingers."""
POST_RADIUS_M = 0.008
BAR_GIVES_M = 0.012
"""How far the bar gives along the door, on rubber: with a rigid bar, a hand beside its arc would pull with 100 N."""
SHORT_BAR_M = 0.06
"""Greatest length of a bar with one post, in the middle, instead of two at its ends."""

RACK_BEHIND_FRONT_M = 0.07
RACK_HALF_M = (0.145, 0.235, 0.005)
RACK_MASS_KG = 1.363
RACK_TRAVEL_M = 0.30
RACK_FRICTION_N = 0.5
RACK_DAMPING_N_S_M = 2.0
RACK_WIRES = 12
RAIL_HALF_M = (0.162, 0.008, 0.004)

FACING_FRONT = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
"""Turns the axis of a cylinder to x."""


@dataclass(frozen=True)
class Oven:
    """An oven that stands still. Its frame lies on the table, under its middle, x pointing in.

    Attributes:
        name: body; also the prefix of the door (`..._door`), its hinge (`..._hinge`), the rack (`..._rack`) and
            its slide (`..._slide`).
        handle_y_m: right and left end of the door's handle. It is short, so that a gripper has to aim.
        handle_radius_m: of that handle.
        rack_m: height of the rack's middle above the table.
    """

    top_m: ClassVar[float] = HEIGHT_M
    """Height of the top above the table."""
    front_m: ClassVar[float] = -HALF_DEPTH_M
    """The plane of the opening: its x in the oven's frame."""

    name: str = "oven"
    handle_y_m: tuple[float, float] = (-0.085, 0.085)
    handle_radius_m: float = 0.010
    rack_m: float = 0.2885

    @property
    def rack_top_m(self) -> float:
        """Height of what lies on the rack, above the table."""
        return self.rack_m + RACK_HALF_M[2]

    def handle(self, door_rad: float, y_m: float) -> NDArray[np.float64]:
        """(3,) the point of the bar that is `y_m` to the left of the middle while the door is open by `door_rad`; oven's frame, m."""
        sin, cos = np.sin(door_rad), np.cos(door_rad)
        out, up = DOOR_HALF_M[0] + HANDLE_STAND_OFF_M, HANDLE_Z_M
        hinge_x = self.front_m - HINGE_BEFORE_FRONT_M
        return np.array([hinge_x - out * cos - up * sin, y_m, FLOOR_M + up * cos - out * sin])

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write body, door and rack."""
        for part, rgba, emission in (("liner", ENAMEL, LINER_EMISSION), ("lamp", LAMP, LAMP_EMISSION)):
            spec.add_material(name=f"{self.name}_{part}", rgba=rgba, emission=emission)
        body = spec.worldbody.add_body(name=self.name)
        self._add_body(body)
        self._add_inside(body)
        self._add_panel(body)
        self._add_door(body)
        self._add_rack(body)
        for part in ("door", "rack"):
            spec.add_exclude(bodyname1=self.name, bodyname2=f"{self.name}_{part}")

    def _add_body(self, body) -> None:
        """Plinth, head, walls and back, on four feet."""
        x, y = HALF_DEPTH_M, HALF_WIDTH_M
        low, high = (FOOT_HEIGHT_M + FLOOR_M) / 2, (CEILING_M + HEIGHT_M) / 2
        middle, half = (FLOOR_M + CEILING_M) / 2, (CEILING_M - FLOOR_M) / 2
        prop.add_box(body, (0, 0, low), (x, y, (FLOOR_M - FOOT_HEIGHT_M) / 2), rgba=DARK)
        prop.add_box(body, (0, 0, high), (x, y, (HEIGHT_M - CEILING_M) / 2), rgba=STEEL)
        prop.add_box(body, (x - BACK_HALF_M, 0, middle), (BACK_HALF_M, y - 0.02, half), rgba=DARK)
        for side in (-1, 1):
            wall = (0, side * (y - WALL_HALF_M), middle)
            prop.add_box(body, wall, (x, WALL_HALF_M, half), rgba=STEEL)
            for end in (-1, 1):
                foot = (end * (x - FOOT_INSET_M[0]), side * (y - FOOT_INSET_M[1]), FOOT_HEIGHT_M / 2)
                prop.add_cylinder(body, foot, FOOT_RADIUS_M, FOOT_HEIGHT_M / 2, rgba=DARK)

    def _add_inside(self, body) -> None:
        """Bright enamel, a lamp under the ceiling, and the rails that the rack slides on."""
        x, y, sheet = HALF_DEPTH_M - 2 * BACK_HALF_M, HALF_WIDTH_M - 2 * WALL_HALF_M, 0.0005
        middle, half = (FLOOR_M + CEILING_M) / 2, (CEILING_M - FLOOR_M) / 2
        liner, centre_x = f"{self.name}_liner", -BACK_HALF_M
        for position, size in (
            ((x, 0, middle), (sheet, y, half)),
            ((centre_x, 0, FLOOR_M), (x - centre_x, y, sheet)),
            ((centre_x, 0, CEILING_M), (x - centre_x, y, sheet)),
            ((centre_x, -y, middle), (x - centre_x, sheet, half)),
            ((centre_x, y, middle), (x - centre_x, sheet, half)),
        ):
            prop.add_visual_box(body, position, size, material=liner)
        prop.add_visual_box(
            body, (0.03, 0, CEILING_M - 0.006), (0.035, 0.06, 0.006), material=f"{self.name}_lamp"
        )
        rail_z = self.rack_m - RACK_HALF_M[2] - RAIL_HALF_M[2]
        for side in (-1, 1):
            prop.add_box(body, (0.02, side * (y - RAIL_HALF_M[1]), rail_z), RAIL_HALF_M, rgba=WIRE)

    def _add_panel(self, body) -> None:
        """Dark panel with four knobs and a clock, above the door."""
        height = (CEILING_M + HEIGHT_M) / 2
        prop.add_visual_box(body, (self.front_m, 0, height), (0.001, HALF_WIDTH_M - 0.012, 0.055), rgba=DARK)
        prop.add_visual_box(body, (self.front_m, 0, height), (0.0016, 0.045, 0.02), rgba=DISPLAY)
        for y in (-0.20, -0.12, 0.12, 0.20):
            for depth, radius, rgba in ((0.008, 0.021, STEEL), (0.018, 0.015, METAL)):
                looks = {"quat": FACING_FRONT, "rgba": rgba, **prop.VISUAL_ONLY}
                prop.add_cylinder(body, (self.front_m - depth / 2, y, height), radius, depth / 2, **looks)

    def _add_door(self, oven) -> None:
        door = oven.add_body(name=f"{self.name}_door", pos=(self.front_m - HINGE_BEFORE_FRONT_M, 0, FLOOR_M))
        brake = (DOOR_FRICTION_NM, DOOR_DAMPING_NM_S)
        prop.add_joint(door, prop.HINGE, f"{self.name}_hinge", (0, -1, 0), (0, DOOR_RANGE_RAD), *brake)
        x, y, z = DOOR_HALF_M
        middle = z + DOOR_LIFT_M
        prop.add_box(door, (0, 0, middle), DOOR_HALF_M, mass=DOOR_MASS_KG, rgba=STEEL)
        prop.add_visual_box(door, (0, 0, middle), (x + 0.0008, y - 0.010, z - 0.010), rgba=DARK)
        prop.add_visual_box(door, (0, 0, middle - 0.02), (x + 0.0014, y - 0.055, z - 0.070), rgba=GLASS)
        self._add_handle(door)

    def _add_handle(self, door) -> None:
        handle = door.add_body(name=f"{self.name}_bar")
        travel_m = (-BAR_GIVES_M, BAR_GIVES_M)
        prop.add_joint(handle, prop.SLIDE, f"{self.name}_rubber", (0, 0, 1), travel_m, **prop.ON_RUBBER)
        right, left = self.handle_y_m
        x, z = -DOOR_HALF_M[0] - HANDLE_STAND_OFF_M, HANDLE_Z_M
        metal = {"friction": (1.0, 0.01, 0.0001), "rgba": METAL}
        prop.add_capsule(handle, (x, right, z, x, left, z), self.handle_radius_m, mass=0.05, **metal)
        for y in self.handle_y_m if left - right > SHORT_BAR_M else [(right + left) / 2]:
            prop.add_capsule(handle, (x, y, z, -DOOR_HALF_M[0], y, z), POST_RADIUS_M, mass=0.02, **metal)

    def _add_rack(self, oven) -> None:
        """A plate in physics, a grid of wires for the eye."""
        rack_x = self.front_m + RACK_BEHIND_FRONT_M + RACK_HALF_M[0]
        rack = oven.add_body(name=f"{self.name}_rack", pos=(rack_x, 0, self.rack_m))
        brake = (RACK_FRICTION_N, RACK_DAMPING_N_S_M)
        prop.add_joint(rack, prop.SLIDE, f"{self.name}_slide", (-1, 0, 0), (0, RACK_TRAVEL_M), *brake)
        prop.add_box(rack, (0, 0, 0), RACK_HALF_M, mass=RACK_MASS_KG, **prop.COLLISION_ONLY)
        x, y, radius = RACK_HALF_M
        for side in (-1, 1):
            prop.add_visual_box(rack, (side * (x - radius), 0, 0), (radius, y, radius), rgba=WIRE)
            prop.add_visual_box(rack, (0, side * (y - radius), 0), (x, radius, radius), rgba=WIRE)
        for wire_y in np.linspace(-y, y, RACK_WIRES + 2)[1:-1]:
            ends = (-x + radius, wire_y, radius / 2, x - radius, wire_y, radius / 2)
            prop.add_capsule(rack, ends, radius / 2, rgba=WIRE, **prop.VISUAL_ONLY)
