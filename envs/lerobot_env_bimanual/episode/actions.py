"""The two kinds of action, and how invalid ones are handled.

| action | `joint`, `keypose` (strict) | `auto` (learned values) |
|---|---|---|
| no vector of real numbers, wrong length | `InvalidAction` | `InvalidAction` |
| NaN or infinite as float32 | `InvalidAction` | `InvalidAction` |
| gripper outside 0..1 | clipped | clipped |
| joint target outside its limits, by at most 0.1 rad | clipped | clipped |
| joint target further outside | `InvalidAction` | clipped |
| zero quaternion | `InvalidAction` | the episode ends as a failure |
| other quaternion, flags | normalised, true above 0.5 | the same |

Clipping a policy's regressed targets is common practice, and an untrained network must be able to run through
`lerobot-eval`. In a strict mode, such a target is a mistake of the caller. Keyposes that cannot be reached
are valid actions: they end the episode as a failure in every mode.

An `InvalidAction` leaves a single environment as it was: its caller made a mistake, and may go on with a better action.
In a vector environment it ends the episode of its own environment as a failure, as no caller can correct one of many
(see `lerobot_env_bimanual.vector`).

Joint actions are then limited to what real arms can follow. Two consecutive ones may differ by at most what a Panda's joints
can move in a tick, and that difference may change by at most what they can accelerate ("Limits" of the Franka Control
Interface documentation, as in `robots.panda`). An action beyond these limits is replaced by one within them, such that the arm
catches up with the wanted action as soon as it can without overshoot. The experts stay far below the limits, so their actions
are not changed.
"""

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset.schema import JOINT_NAMES
from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM, by_arm
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM, POSITION, QUATERNION
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.motion.planner import KeyposeFailure
from lerobot_env_bimanual.robots.panda_pair import ArmPair
from lerobot_env_bimanual.world.servo_commands import TICK_S

JOINT_TOLERANCE_RAD = 0.1
SHARE = 0.9999
"""Share of the limits that replacement actions use, so that they keep the limits when rounded to float32."""
EMPTY_ACTION = np.zeros(0, np.float32)
"""Recorded in place of an action that could not be read."""


class ActionReader:
    """Turns the vectors given to `step` into a joint action that the arms can follow, or a keypose."""

    def __init__(self, control_mode: str, arm_pair: ArmPair):
        self._mode = control_mode
        self._strict = control_mode != "auto"
        self.lower = np.array([*arm_pair.joint_lower, 0.0] * len(ARMS), dtype=np.float32)
        self.upper = np.array([*arm_pair.joint_upper, 1.0] * len(ARMS), dtype=np.float32)
        # A gripper goes from shut to open within a tick.
        self._max_step, self._max_step_change = np.full((2, JOINT_ACTION_DIM), 2.0)
        by_arm(self._max_step)[:, :-1] = arm_pair.velocity_limit_rad_s * TICK_S
        by_arm(self._max_step_change)[:, :-1] = arm_pair.acceleration_limit_rad_s2 * TICK_S**2

    @property
    def lengths(self) -> tuple[int, ...]:
        """Numbers that an action may have."""
        modes = {"auto": (JOINT_ACTION_DIM, KEYPOSE_DIM), "joint": (JOINT_ACTION_DIM,)}
        return modes.get(self._mode, (KEYPOSE_DIM,))

    @property
    def space(self) -> spaces.Box:
        """The declared space: 18 numbers in mode `keypose`, else 16, although `auto` takes both."""
        if self._mode == "keypose":
            low = np.zeros((len(ARMS), ARM_KEYPOSE_DIM), dtype=np.float32)
            high = np.ones_like(low)
            low[:, QUATERNION] = -1.0
            # As float32 the border may lie outside, and the upper one always does.
            low[:, POSITION] = np.nextafter(np.array(VOXEL_WORKSPACE.lower, np.float32), np.float32(np.inf))
            high[:, POSITION] = np.nextafter(np.array(VOXEL_WORKSPACE.upper, np.float32), np.float32(-np.inf))
            return spaces.Box(low.ravel(), high.ravel(), dtype=np.float32)
        return spaces.Box(self.lower, self.upper, dtype=np.float32)

    def vector(self, action: ArrayLike) -> NDArray[np.float32]:
        """An action as a vector of a length that the mode has; its values may still be refused.

        Raises:
            InvalidAction: it has another shape, or does not consist of real numbers.
        """
        lengths = " or ".join(map(str, self.lengths))
        wanted = f"control mode {self._mode!r} takes a vector of {lengths} numbers"
        try:
            vector = np.asarray(action)
        except (ValueError, TypeError, RuntimeError) as error:  # ragged, or a tensor with a gradient
            raise InvalidAction(f"{wanted}, got what NumPy cannot read: {error}") from error
        if vector.ndim != 1 or vector.size not in self.lengths:
            raise InvalidAction(f"{wanted}, got shape {vector.shape}")
        if vector.dtype.kind not in "iuf":
            raise InvalidAction(f"{wanted}, got {vector.dtype.name} values")
        with np.errstate(over="ignore"):  # what is too large becomes infinite
            return vector.astype(np.float32)

    def read(self, vector: NDArray[np.float32]) -> NDArray[np.float32] | BimanualKeypose:
        """A joint action (16,) within the limits, or a keypose, of a vector that `vector` has returned.

        Raises:
            InvalidAction: see the table above.
            KeyposeFailure: a zero quaternion in mode `auto`.
        """
        if vector.size == KEYPOSE_DIM:
            return self._read_keypose(vector)
        if not np.isfinite(vector).all():
            bad = [JOINT_NAMES[i] for i in np.flatnonzero(~np.isfinite(vector))]
            raise InvalidAction(f"joint action is not finite in: {', '.join(bad)}")
        clipped = np.clip(vector, self.lower, self.upper)
        for i in np.flatnonzero(np.abs(vector - clipped) > JOINT_TOLERANCE_RAD) if self._strict else ():
            if not JOINT_NAMES[i].endswith("gripper"):
                raise InvalidAction(
                    f"{JOINT_NAMES[i]} = {vector[i]:.3f} rad is outside its limits "
                    f"[{self.lower[i]:.3f}, {self.upper[i]:.3f}] by more than {JOINT_TOLERANCE_RAD} rad"
                )
        return clipped

    def limited(self, wanted: NDArray[np.float32], progress: EpisodeProgress) -> NDArray[np.float32]:
        """The action (16,) within the limits that replaces a wanted one, given the last actions in `progress`."""
        step = np.subtract(wanted, progress.sent_action, dtype=np.float64)
        of_target = np.clip(
            np.subtract(wanted, progress.wanted, dtype=np.float64), -self._max_step, self._max_step
        )
        behind = step - of_target  # how far from keeping pace with what is wanted
        too_far = np.abs(behind) > self._max_step_change
        is_beyond = (
            too_far
            | (np.abs(step) > self._max_step)
            | (np.abs(step - progress.change) > self._max_step_change)
        )
        if not is_beyond.any():
            return wanted
        max_step, max_change = SHARE * self._max_step, SHARE * self._max_step_change
        # At this speed it has caught up after the remaining way, if it slows down by `max_change` every tick.
        closing = (np.sqrt(max_change**2 + 8 * max_change * np.abs(behind)) - max_change) / 2
        slower = of_target + np.copysign(np.minimum(np.abs(behind), closing), behind)
        slower = np.clip(slower, -max_step, max_step).clip(
            progress.change - max_change, progress.change + max_change
        )
        sent_action = (progress.sent_action + np.where(is_beyond, slower, step)).astype(np.float32)
        return np.clip(sent_action, self.lower, self.upper)

    def _read_keypose(self, vector: NDArray) -> BimanualKeypose:
        try:
            return BimanualKeypose.from_vector(vector)
        except InvalidAction as error:
            if self._strict or not np.isfinite(vector).all():
                raise
            quaternions = vector.reshape(len(ARMS), ARM_KEYPOSE_DIM)[:, QUATERNION]
            arm = ARMS[int(np.argmin(np.linalg.norm(quaternions, axis=1)))]
            raise KeyposeFailure(arm, "zero quaternion") from error
