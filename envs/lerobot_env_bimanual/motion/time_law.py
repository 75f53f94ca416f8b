"""How fast a joint path is travelled: one minimum-jerk law for both arms, which end together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_env_bimanual.motion.kinematics import ArmKinematics

Array = NDArray[np.floating]

MIN_DURATION_S = 0.35
SAMPLES = 48
"""Samples of a path at which its speed is looked at."""


@dataclass(frozen=True)
class SpeedLimits:
    """Peak speeds of one arm.

    Attributes:
        joint_rad_s: of the fastest joint.
        tip_m_s: of the tool centre point.
    """

    joint_rad_s: float
    tip_m_s: float

    def slowed(self, factor: float) -> "SpeedLimits":
        """The same, divided by `factor`."""
        return SpeedLimits(self.joint_rad_s / factor, self.tip_m_s / factor)


FREE_SPEED = SpeedLimits(joint_rad_s=1.3, tip_m_s=0.7)
CONTACT_SPEED = SpeedLimits(joint_rad_s=1.3, tip_m_s=0.35)
"""Grasps, pulls and pushes need half the speed of free motions (design study)."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """A polyline in one arm's joint space over the common path parameter of both arms.

    Attributes:
        fractions: (n,) increasing from 0 to 1.
        knots: (n, 7) rad.
    """

    fractions: Array
    knots: Array

    @classmethod
    def even(cls, knots: Array) -> "JointPath":
        """Knots (n, 7) at equal steps of the path parameter."""
        return cls(np.linspace(0.0, 1.0, len(knots)), knots)

    def at(self, fractions: Array) -> Array:
        """Joints (m, 7) in rad at path parameters (m,)."""
        upper = np.clip(np.searchsorted(self.fractions, fractions), 1, len(self.fractions) - 1)
        before, after = self.fractions[upper - 1], self.fractions[upper]
        share = ((fractions - before) / (after - before))[:, None]
        # Exact at both knots, so that a path ends where it was planned to end.
        return (1.0 - share) * self.knots[upper - 1] + share * self.knots[upper]


def minimum_jerk(progress: Array) -> Array:
    """Path parameter at a share of the duration, both 0 to 1: at rest at both ends, peak speed 1.875."""
    return progress**3 * (10.0 + progress * (6.0 * progress - 15.0))


def motion_ticks(
    paths: Sequence[JointPath], kinematics: Sequence[ArmKinematics], limits: Sequence[SpeedLimits]
) -> int:
    """Control ticks for both arms' paths, so that neither arm exceeds its limits."""
    fractions = minimum_jerk(np.linspace(0.0, 1.0, SAMPLES + 1))
    seconds = MIN_DURATION_S
    for path, arm, limit in zip(paths, kinematics, limits, strict=True):
        joints = path.at(fractions)
        tips = np.array([arm.fk(posture)[:3, 3] for posture in joints])
        fastest_joint = np.abs(np.diff(joints, axis=0)).max() * SAMPLES
        fastest_tip = np.linalg.norm(np.diff(tips, axis=0), axis=1).max() * SAMPLES
        seconds = max(seconds, fastest_joint / limit.joint_rad_s, fastest_tip / limit.tip_m_s)
    return int(np.ceil(seconds * CONTROL_HZ - 1e-9))


def sample_ticks(path: JointPath, ticks: int) -> Array:
    """Joint targets (ticks, 7) in rad, one per control tick, the last one at the end of the path."""
    return path.at(minimum_jerk(np.arange(1, ticks + 1) / ticks))
