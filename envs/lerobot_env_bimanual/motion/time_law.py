"""How fast the arms travel their paths: one minimum-jerk law for both, which end together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_env_bimanual.robots.kinematics import ArmKinematics

Array = NDArray[np.floating]

MIN_DURATION_S = 0.35
PEAK_OVER_MEAN = 1.875
"""Peak speed of the minimum-jerk law, relative to its mean speed."""
SAMPLES = 64
"""Least number of stretches in which the speed along a motion is chosen."""


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
CONTACT_SPEED = SpeedLimits(joint_rad_s=0.8, tip_m_s=0.35)
"""Grasps, pulls and pushes need about half the speed of free motions."""


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

    @property
    def is_still(self) -> bool:
        """Whether the arm does not move at all."""
        return bool((self.knots == self.knots[0]).all())

    def at(self, fractions: Array) -> Array:
        """Joints (m, 7) in rad at path parameters (m,)."""
        upper = np.clip(np.searchsorted(self.fractions, fractions), 1, len(self.fractions) - 1)
        before, after = self.fractions[upper - 1], self.fractions[upper]
        share = ((fractions - before) / (after - before))[:, None]
        # Exact at both knots, so that a path ends where it was planned to end.
        return (1.0 - share) * self.knots[upper - 1] + share * self.knots[upper]


def minimum_jerk(progress: Array) -> Array:
    """Share of the way at a share of the duration, both 0 to 1; at rest at both ends."""
    return progress**3 * (10.0 + progress * (6.0 * progress - 15.0))


def tick_fractions(
    paths: Sequence[JointPath], kinematics: Sequence[ArmKinematics], limits: Sequence[SpeedLimits]
) -> Array:
    """Path parameters (ticks,) at the end of each control tick of a motion; the last one is 1.

    The arms stay in step: both are at the same path parameter at any time, so what was checked for their paths
    together holds for their motion. Where either arm would have to hurry, the parameter advances more slowly;
    on the way so stretched, the minimum-jerk law is applied.

    Args:
        paths: both arms' paths.
        kinematics: both arms.
        limits: both arms' peak speeds.
    """
    grid = np.union1d(np.linspace(0.0, 1.0, SAMPLES + 1), np.concatenate([path.fractions for path in paths]))
    seconds = np.zeros(len(grid) - 1)
    for path, arm, limit in zip(paths, kinematics, limits, strict=True):
        joints = path.at(grid)
        tips = np.array([arm.fk(posture)[:3, 3] for posture in joints])
        joint_seconds = np.abs(np.diff(joints, axis=0)).max(axis=1) / limit.joint_rad_s
        tip_seconds = np.linalg.norm(np.diff(tips, axis=0), axis=1) / limit.tip_m_s
        seconds = np.maximum(seconds, np.maximum(joint_seconds, tip_seconds))
    duration = max(MIN_DURATION_S, PEAK_OVER_MEAN * seconds.sum())
    ticks = int(np.ceil(duration * CONTROL_HZ - 1e-9))
    way = np.concatenate([[0.0], seconds.cumsum()])
    fractions = np.interp(minimum_jerk(np.arange(1, ticks + 1) / ticks) * way[-1], way, grid)
    fractions[-1] = 1.0
    return fractions
