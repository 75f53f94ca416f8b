"""The joint action: what one control tick commands, per arm seven joint targets and the gripper; and keyframe discovery in them.

As a vector (16,) it is what `BimanualEnv.step` takes and the column `action` stores: left joints in rad, left gripper
from 0 closed to 1 open, then the same of the right arm.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM

CONTROL_HZ = 20
"""Control ticks per second; one tick is one dataset frame (RLBench records one observation per 0.05 s)."""

ARM_ACTION_DIM = JOINTS_PER_ARM + 1
JOINT_ACTION_DIM = len(ARMS) * ARM_ACTION_DIM
GRIPPERS = slice(JOINTS_PER_ARM, None, ARM_ACTION_DIM)
"""The two gripper entries of a vector."""

STILL_RAD = 5e-5
"""Change of a commanded joint per frame below which it rests: 0.001 rad/s at 20 Hz."""

MIN_REST_FRAMES = 2
"""Shortest rest that ends a keypose."""

GRIPPER_FRAMES = 10
"""Half a second, in which a gripper opens or closes: 40 mm per finger at 0.1 m/s, and a moment to press."""


def by_arm[T: np.generic](actions: NDArray[T]) -> NDArray[T]:
    """The same numbers with an axis for the arms, (..., 16) -> (..., 2, 8); a view of contiguous arrays."""
    return actions.reshape(*actions.shape[:-1], len(ARMS), ARM_ACTION_DIM)


def discover_keyframes(actions: ArrayLike) -> list[int]:
    """Frames at which motion resumes after both arms rested, or a gripper changes during motion; the last one always.

    If grippers change one after the other in one rest, as in a handover, each change is a keypose, which ends when that
    gripper has had `GRIPPER_FRAMES` frames.

    PerAct2 takes a frame where a gripper changed or both arms stopped. There the gripper closes between two
    frames; here closing takes half a second, in which the arms rest, so the keypose is complete when the rest
    ends. Commanded joints are read instead of measured speeds, which never quite vanish in an arm that pushes.

    Args:
        actions: (T, 16) recorded joint actions, per arm seven joints in radians and the gripper opening.

    Returns:
        Rising frame indices in [1, T).
    """
    arms = by_arm(np.asarray(actions, dtype=np.float64).reshape(-1, JOINT_ACTION_DIM))
    frames = len(arms)
    if frames < 2:
        return []
    still = np.ones(frames, dtype=bool)
    still[1:] = (np.abs(np.diff(arms[..., :JOINTS_PER_ARM], axis=0)) < STILL_RAD).all(axis=(1, 2))
    grippers = arms[..., JOINTS_PER_ARM] > 0.5
    changed = np.zeros(frames, dtype=bool)
    changed[1:] = (grippers[1:] != grippers[:-1]).any(axis=1)

    keyframes: list[int] = []
    rested, moved = 0, False
    gripped: int | None = None  # last gripper change of the present rest
    for frame in range(1, frames):
        if still[frame]:
            rested += 1
            if changed[frame]:
                if gripped is not None:
                    keyframes.append(min(gripped + GRIPPER_FRAMES, frame - 1))
                gripped = frame
            continue
        if (moved and rested >= MIN_REST_FRAMES) or gripped is not None or changed[frame]:
            keyframes.append(frame)
        rested, moved, gripped = 0, True, None
    if keyframes and keyframes[-1] >= frames - 2:
        keyframes.pop()
    return [*keyframes, frames - 1]
