"""A springy rope with knotted ends that lies in the shape of an S."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import HINGE, add_capsule

TAIL = (0.15, 0.30, 0.85, 1.0)
HEAD = (0.90, 0.10, 0.08, 1.0)
STRANDS = ((0.93, 0.62, 0.36, 1.0), (0.87, 0.52, 0.27, 1.0))
"""Colours of odd and even links, which make it look twisted."""

BEND_RAD = 1.1587
"""Largest heading of the S away from the line between the ends, which are 0.268 m apart then (PerAct2 code)."""
STIFFNESS_NM = 0.8
"""Per radian, towards the S. It takes 5 N to hold the ends 0.345 m apart; once released, they are back at 0.267 m after 0.2 s.
If one end is dragged over the table, the other end lags 0.293 m behind."""
DAMPING_NM_S = 1e-2
JOINT_ARMATURE = 1e-4
ROOT_ARMATURE = 1e-3
"""Armature of the free joint, in kg and kg m2, so that a closed hand may press on the rope from above."""
GAP_M = 0.001
"""Between the middles of neighbouring links' end caps."""
KNOT_HALF_LENGTH_M = 0.00325


@dataclass(frozen=True)
class Rope:
    """A chain of capsules that bends to all sides, against springs towards its S, but does not twist.

    The root body is the tail link, `<name>_<last>` the head link. Each link's frame lies in its middle, x pointing
    to the next link.

    Attributes:
        name: body of the tail; also the prefix of the other links' bodies.
        links: number of links.
        pitch_m: from one link's middle to the next one's.
        radius_m: of the rope. (1.5 times the original's: fingers have to get hold of it.)
        knot_radius_m: of the two end links.
        link_mass_kg: of each link (PerAct2 code).
        friction: against everything but the grippers' rubber; the table's own.
    """

    name: str = "rope"
    links: int = 18
    pitch_m: float = 0.0225
    radius_m: float = 0.0075
    knot_radius_m: float = 0.012
    link_mass_kg: float = 0.0251
    friction: float = 0.5

    @property
    def tail(self) -> str:
        """Body of the first link."""
        return self.name

    @property
    def head(self) -> str:
        """Body of the last link."""
        return self._link(self.links - 1)

    @property
    def tail_heading_rad(self) -> float:
        """Heading of the tail link, from the line that leads from the tail to the head."""
        return float(self._headings[0])

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write one link inside the other."""
        body = spec.worldbody.add_body(name=self.tail)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_FREE, armature=ROOT_ARMATURE)
        self._add_capsule(body, 0)
        for index, turn_rad in enumerate(np.diff(self._headings), start=1):
            body = self._add_link(body, index, turn_rad)
        # Caps of next but one links overlap when the rope bends; direct neighbours never collide anyway.
        for index in range(self.links - 2):
            spec.add_exclude(bodyname1=self._link(index), bodyname2=self._link(index + 2))

    def _add_link(self, parent, index: int, turn_rad: float):
        half = self.pitch_m / 2
        body = parent.add_body(
            name=self._link(index),
            pos=(half + half * np.cos(turn_rad), half * np.sin(turn_rad), 0),
            quat=quat_wxyz_from_axis_angle((0, 0, 1), turn_rad),
        )
        spring = {"stiffness": STIFFNESS_NM, "damping": DAMPING_NM_S, "armature": JOINT_ARMATURE}
        for axis in ((0, 0, 1), (0, 1, 0)):
            body.add_joint(type=HINGE, pos=(-half, 0, 0), axis=axis, **spring)
        self._add_capsule(body, index)
        return body

    def _add_capsule(self, body, index: int) -> None:
        is_end = index in (0, self.links - 1)
        half = KNOT_HALF_LENGTH_M if is_end else self.pitch_m / 2 - GAP_M
        radius = self.knot_radius_m if is_end else self.radius_m
        rgba = {0: TAIL, self.links - 1: HEAD}.get(index, STRANDS[index % 2])
        contact = {"friction": (self.friction, 0.01, 0.001), "condim": 4, "solref": (0.006, 1)}
        add_capsule(body, (-half, 0, 0, half, 0, 0), radius, mass=self.link_mass_kg, rgba=rgba, **contact)

    @property
    def _headings(self) -> NDArray[np.float64]:
        """(links,) of the links, from the line that leads from the tail to the head."""
        between = BEND_RAD * np.cos(2 * np.pi * (np.arange(self.links - 1) + 0.5) / (self.links - 1))
        return np.concatenate([between[:1], (between[1:] + between[:-1]) / 2, between[-1:]])

    def _link(self, index: int) -> str:
        return f"{self.name}_{index}" if index else self.name
