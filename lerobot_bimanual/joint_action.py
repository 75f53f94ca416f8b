"""The joint action: what one control tick commands, per arm seven joint targets and the gripper.

As a vector (16,) it is what `BimanualEnv.step` takes and the column `action` stores: left joints in rad, left gripper
from 0 closed to 1 open, then the same of the right arm.
"""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM

CONTROL_HZ = 20
"""Control ticks per second; one tick is one dataset frame (RLBench records one observation per 0.05 s)."""

ARM_ACTION_DIM = JOINTS_PER_ARM + 1
JOINT_ACTION_DIM = len(ARMS) * ARM_ACTION_DIM
GRIPPERS = slice(JOINTS_PER_ARM, None, ARM_ACTION_DIM)
"""The two gripper entries of a vector."""


def by_arm[T: np.generic](actions: NDArray[T]) -> NDArray[T]:
    """The same numbers with an axis for the arms, (..., 16) -> (..., 2, 8); a view of contiguous arrays."""
    return actions.reshape(*actions.shape[:-1], len(ARMS), ARM_ACTION_DIM)
