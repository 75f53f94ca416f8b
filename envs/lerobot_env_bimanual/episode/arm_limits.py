"""What real arms allow in an episode: how fast they follow actions, and when they stop themselves.

Two consecutive joint actions may differ by what a Panda's joints move in a tick at most, and that difference may change by
what they accelerate ("Limits" of the Franka Control Interface documentation, as in `robots.panda`). An action beyond it is
replaced by one within it, such that the arm catches up with what is wanted as soon as it can and without passing it. The
experts stay far below, so their actions go through as they are.

A Panda stops with a reflex when the outside force that it estimates passes the thresholds that its user has set
(`setCollisionBehavior` of libfranka, "upper thresholds"); where contact is meant, libfranka's examples of impedance and force
control set 100 N. With the option `protective_stop` an episode ends that way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM, by_arm
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.robots.panda_pair import ArmPair
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contact_forces import ContactForces, felt
from lerobot_env_bimanual.world.scene_view import SceneView
from lerobot_env_bimanual.world.servo_commands import TICK_S

PROTECTIVE_STOP = "protective stop"
"""Beginning of the failure of an episode that ended so."""
SHARE = 0.9999
"""Of the limits that replaced actions keep, so that they keep the limits when they are rounded to float32."""
MAX_FORCE_N = 100.0
"""With which an arm may press, unless the task has a bound of its own."""
MAX_PRESS_S = 0.1
"""For how long it may press harder."""


class StepLimiter:
    """Keeps joint actions within what the arms can follow.

    Args:
        arm_pair: whose limits of velocity and acceleration hold; fingers have a speed of their own.
    """

    def __init__(self, arm_pair: ArmPair):
        limits = arm_pair.joint_limits
        # A gripper goes from shut to open within a tick.
        self._most, self._more = np.full((2, JOINT_ACTION_DIM), 2.0)
        by_arm(self._most)[:, :-1] = limits.velocity_rad_s * TICK_S
        by_arm(self._more)[:, :-1] = limits.acceleration_rad_s2 * TICK_S**2
        self._lower = np.array([*arm_pair.joint_lower, 0.0] * len(ARMS), dtype=np.float32)
        self._upper = np.array([*arm_pair.joint_upper, 1.0] * len(ARMS), dtype=np.float32)

    def limited(self, wanted: NDArray[np.float32], progress: EpisodeProgress) -> NDArray[np.float32]:
        """The action (16,) that the arms are given for a wanted one, after those that `progress` remembers."""
        step = np.subtract(wanted, progress.asked, dtype=np.float64)
        of_target = np.clip(np.subtract(wanted, progress.wanted, dtype=np.float64), -self._most, self._most)
        behind = step - of_target  # how far from keeping pace with what is wanted
        too_far = np.abs(behind) > self._more
        is_beyond = too_far | (np.abs(step) > self._most) | (np.abs(step - progress.change) > self._more)
        if not is_beyond.any():
            return wanted
        most, more = SHARE * self._most, SHARE * self._more
        # At this speed it has caught up after the remaining way, if it slows down by `more` every tick.
        closing = (np.sqrt(more**2 + 8 * more * np.abs(behind)) - more) / 2
        slower = of_target + np.copysign(np.minimum(np.abs(behind), closing), behind)
        slower = np.clip(slower, -most, most).clip(progress.change - more, progress.change + more)
        asked = (progress.asked + np.where(is_beyond, slower, step)).astype(np.float32)
        return np.clip(asked, self._lower, self._upper)


def max_force_n(task: TaskSpec) -> float:
    """With which an arm may press in a task."""
    return task.load_bounds.get("contact_force_n", MAX_FORCE_N)


class ProtectiveStop:
    """Ends an episode as a failure when an arm presses too hard for too long.

    Args:
        scene: its world.
        max_force_n: with which an arm may press.
    """

    def __init__(self, scene: SceneView, max_force_n: float):
        self._forces, self._max_force_n = ContactForces(scene), max_force_n
        self.note_step = self._forces.note

    def judge(self, progress: EpisodeProgress) -> None:
        """Look at the steps of a tick."""
        forces_n, _, _ = self._forces.take()
        felt_n = felt(forces_n, progress.felt_n)
        progress.felt_n = felt_n[-1]
        for pressed_n in np.linalg.norm(felt_n, axis=-1):
            progress.pressed_steps = (progress.pressed_steps + 1) * (pressed_n > self._max_force_n)
            if progress.pressed_steps.max() * PHYSICS_STEP_S >= MAX_PRESS_S:
                arm = ARMS[int(progress.pressed_steps.argmax())]
                force_n = pressed_n[arm.ordinal]
                progress.failure = f"{PROTECTIVE_STOP}: the {arm} arm pressed with {force_n:.0f} N"
                return
