"""Time laws of paths: both arms in step, smooth, as fast as a pace allows joints and hands; slower beside heavy props.

First, the fastest speed along the path that keeps the limits of velocity and acceleration is computed: one pass forward
for speeding up, one backward for braking (Bobrow et al., "Time-Optimal Control of Robotic Manipulators Along Specified
Paths", IJRR 1985). A moving average over time then smooths the steps of the acceleration. Control ticks are sampled
from the result; if they still exceed a limit, the motion takes more ticks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import is_free
from lerobot_env_bimanual.motion.joint_path import JointPath
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene_view import SceneView

Array = NDArray[np.floating]

STEPS = 64
"""Stretches of the path in which speeds are chosen."""
SMOOTHING_S = 0.1
"""Time over which the law is averaged: accelerations come and go over this time."""
BEND_SHARE = 0.7
"""Largest share of the acceleration that may go into following the path's bends at constant speed."""
ROUNDING = 1e-3
"""Relative excess over a limit that is let pass; actions are float32."""


@dataclass(frozen=True)
class Pace:
    """Shares of the arm's own limits, and a speed of the hand.

    Attributes:
        velocity_share: of the joints' velocity limits.
        acceleration_share: of their acceleration limits; also of their jerk limits.
        tip_m_s: greatest speed of the tool centre point.
        tip_m_s2: greatest acceleration of the tool centre point while it gains speed.
    """

    velocity_share: float
    acceleration_share: float
    tip_m_s: float
    tip_m_s2: float = np.inf

    @property
    def velocity_rad_s(self) -> Array:
        """(7,) of each joint."""
        return self.velocity_share * PANDA_PAIR.velocity_limit_rad_s

    @property
    def acceleration_rad_s2(self) -> Array:
        """(7,) of each joint."""
        return self.acceleration_share * PANDA_PAIR.acceleration_limit_rad_s2

    @property
    def acceleration_step_rad_s2(self) -> Array:
        """(7,) largest step between two ticks, within one step of physics: acceleration is constant within a tick."""
        return self.acceleration_share * PANDA_PAIR.jerk_limit_rad_s3 * PHYSICS_STEP_S


FREE = Pace(velocity_share=0.8, acceleration_share=0.5, tip_m_s=1.2)
CONTACT = Pace(velocity_share=0.6, acceleration_share=0.4, tip_m_s=0.5)
"""Pace of grasps, pulls and pushes."""
PUSHING = Pace(velocity_share=0.6, acceleration_share=0.4, tip_m_s=0.5, tip_m_s2=0.5)
"""Pace beside a heavy thing, which the hands have to accelerate to their own speed."""

HEAVY_KG = 20.0
"""Mass from which on a thing takes more force to be set in motion than to be kept in motion."""
BESIDE_M = 0.03
"""Distance from a hand; more than the error of rounded keyposes."""


def is_beside_heavy(scene: SceneView, arm: Arm) -> bool:
    """Whether a hand is within `BESIDE_M` of a free thing of at least `HEAVY_KG`."""
    model, data = scene.model, scene.data
    heavy = [body for body in np.flatnonzero(model.body_subtreemass >= HEAVY_KG) if is_free(model, body)]
    if not heavy:
        return False
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    of_hand = np.flatnonzero(scene.geoms(scene.arm_pair.hand_body(arm)) & touchable).tolist()
    of_heavy = np.flatnonzero(np.isin(model.geom_bodyid, heavy) & touchable).tolist()
    pairs = product(of_hand, of_heavy)
    return any(mujoco.mj_geomDistance(model, data, *pair, BESIDE_M, None) < BESIDE_M for pair in pairs)


def tick_fractions(paths: Sequence[JointPath], paces: Sequence[Pace]) -> Array:
    """Path parameters (ticks,) at the end of each control tick of a motion; the last one is 1.

    The arms stay in step: both are at the same path parameter at any time, so what was checked for their paths
    together holds for their motion. No ticks at all if both stand still. Paths and paces are left before right.
    """
    if all(path.is_still for path in paths):
        return np.empty(0)
    law = _SmoothLaw(_fastest_speeds(paths, paces))
    ticks = int(np.ceil(law.duration_s * CONTROL_HZ))
    while True:
        fractions = law.at(np.arange(1, ticks + 1) / ticks)
        excess = max(
            _excess(path.at(np.append(0.0, fractions)), pace) for path, pace in zip(paths, paces, strict=True)
        )
        if excess <= 1.0 + ROUNDING:
            return fractions
        ticks = max(ticks + 1, int(ticks * excess))


def _fastest_speeds(paths: Sequence[JointPath], paces: Sequence[Pace]) -> Array:
    """Speeds (n,) of the path parameter, 1/s, at equal steps of it; zero at both ends."""
    grid = np.linspace(0.0, 1.0, STEPS + 1)
    step = 1.0 / STEPS
    highest, push, start = np.full((3, len(grid)), np.inf)
    arms = PANDA_PAIR.kinematics.values()
    moving = [case for case in zip(paths, arms, paces, strict=True) if not case[0].is_still]
    slopes, bends = [], []
    with np.errstate(divide="ignore"):
        for path, arm, pace in moving:
            joints = path.at(grid)
            tips = np.array([arm.fk(posture)[:3, 3] for posture in joints])
            slope, bend = _at_nodes(np.abs(np.diff(joints, axis=0)) / step), np.zeros_like(joints)
            bend[1:-1] = np.abs(np.diff(joints, n=2, axis=0)) / step**2
            tip_slope = _at_nodes(np.linalg.norm(np.diff(tips, axis=0), axis=1) / step)
            by_joint = np.minimum(
                pace.velocity_rad_s / slope, np.sqrt(BEND_SHARE * pace.acceleration_rad_s2 / bend)
            )
            highest = np.minimum(highest, np.minimum(by_joint.min(axis=1), pace.tip_m_s / tip_slope))
            start = np.minimum(start, pace.tip_m_s2 / tip_slope)
            slopes.append(slope / pace.acceleration_rad_s2)
            bends.append(bend / pace.acceleration_rad_s2)
        for slope, bend in zip(slopes, bends, strict=True):
            push = np.minimum(push, ((1.0 - bend * highest[:, None] ** 2) / slope).min(axis=1))
    squares = (highest**2).tolist()
    squares[0] = squares[-1] = 0.0
    # What is gained within one step: v dv = a ds.
    gains = (2.0 * step * np.minimum(push[:-1], push[1:])).tolist()
    starts = (2.0 * step * np.minimum(start[:-1], start[1:])).tolist()
    for i in range(STEPS):
        squares[i + 1] = min(squares[i + 1], squares[i] + min(gains[i], starts[i]))
    for i in reversed(range(STEPS)):
        squares[i] = min(squares[i], squares[i + 1] + gains[i])
    return np.sqrt(squares)


class _SmoothLaw:
    """The path parameter over time, averaged over the last `SMOOTHING_S`; from rest to rest it takes `duration_s`.

    It is made from the speeds (n,) of the parameter at equal steps of it, 1/s, between which the acceleration is constant.
    """

    def __init__(self, speeds: Array):
        step = 1.0 / (len(speeds) - 1)
        seconds = 2.0 * step / (speeds[:-1] + speeds[1:])
        self._speeds, self._fractions = speeds[:-1], np.linspace(0.0, 1.0, len(speeds))[:-1]
        self._accelerations = np.diff(speeds) / seconds
        self._times = np.append(0.0, seconds.cumsum())
        self._integrals = np.append(0.0, self._integral_within(np.arange(len(seconds)), seconds).cumsum())
        self.duration_s = self._times[-1] + SMOOTHING_S

    def at(self, progress: Array) -> Array:
        """Path parameters at shares (n,) of the duration; exactly 1 at its end."""
        times = progress * self.duration_s
        fractions = (self._integral(times) - self._integral(times - SMOOTHING_S)) / SMOOTHING_S
        fractions[progress >= 1.0] = 1.0
        return np.clip(fractions, 0.0, 1.0)

    def _integral(self, times: Array) -> Array:
        """Integral of the path parameter from the start to `times`, with rest before and after."""
        inside = np.clip(times, 0.0, self._times[-1])
        index = np.clip(np.searchsorted(self._times, inside, side="right") - 1, 0, len(self._speeds) - 1)
        within = self._integral_within(index, inside - self._times[index])
        return self._integrals[index] + within + np.maximum(times - self._times[-1], 0.0)

    def _integral_within(self, index: NDArray[np.integer], seconds: Array) -> Array:
        """The same from the start of stretch `index` on."""
        speed, acceleration = self._speeds[index], self._accelerations[index]
        return seconds * (self._fractions[index] + seconds * (speed / 2.0 + seconds * acceleration / 6.0))


def _at_nodes(segments: Array) -> Array:
    """The larger value of both neighbouring segments, (n + 1, ...) of (n, ...)."""
    return np.maximum(np.concatenate([segments[:1], segments]), np.concatenate([segments, segments[-1:]]))


def _excess(joints: Array, pace: Pace) -> float:
    """Factor by which a motion (ticks + 1, 7), from its start on, has to be slower, so that its commands keep all limits."""
    at_rest = np.concatenate([joints[:1], joints[:1], joints, joints[-1:], joints[-1:]])
    excess = 0.0
    for order, bounds in enumerate(
        (pace.velocity_rad_s, pace.acceleration_rad_s2, pace.acceleration_step_rad_s2), start=1
    ):
        rate = CONTROL_HZ ** min(order, 2)
        worst = float((np.abs(np.diff(at_rest, n=order, axis=0)).max(axis=0) * rate / bounds).max())
        excess = max(excess, worst ** (1.0 / order))
    return excess
