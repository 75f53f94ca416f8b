"""Keyposes: the targets that experts command and keypose policies predict; `keypose_layout` has them as numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual import keypose_layout as layout
from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical


@dataclass(frozen=True)
class Keypose:
    """One arm's target.

    Attributes:
        pose: hand pose in the world frame: origin between the fingertips, z out of the palm, y along the
            opening of the fingers.
        gripper_open: whether the gripper is open after the motion.
        ignore_collisions: true for a straight contact motion, False for a planned collision-free one.
    """

    pose: Pose
    gripper_open: bool
    ignore_collisions: bool


@dataclass(frozen=True)
class BimanualKeypose:
    """Both arms' targets; the arms start and end their motion together."""

    left: Keypose
    right: Keypose

    def __getitem__(self, arm: Arm) -> Keypose:
        """The target of one arm."""
        return self.left if arm is Arm.LEFT else self.right

    def to_vector(self) -> NDArray[np.float32]:
        """Flat layout, (18,), quaternions with w >= 0."""
        parts = []
        for arm in ARMS:
            target = self[arm]
            flags = [float(target.gripper_open), float(target.ignore_collisions)]
            parts += [target.pose.position, quat_wxyz_canonical(target.pose.quat_wxyz), flags]
        return np.concatenate(parts).astype(np.float32)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> "BimanualKeypose":
        """Read the flat layout.

        Quaternions are normalised and flags are true above 0.5, as learned values are never exact.

        Raises:
            InvalidAction: if the vector has another length, is not finite, or holds a zero quaternion.
        """
        v = np.asarray(vector, dtype=np.float64)
        if v.shape != (layout.KEYPOSE_DIM,):
            raise InvalidAction(
                f"a keypose action has shape ({layout.KEYPOSE_DIM},), got {v.shape}: per arm, left first, "
                f"{', '.join(layout.ARM_KEYPOSE_NAMES)}"
            )
        if not np.isfinite(v).all():
            bad = [layout.KEYPOSE_NAMES[i] for i in np.flatnonzero(~np.isfinite(v))]
            raise InvalidAction(f"keypose action is not finite in: {', '.join(bad)}")
        targets = []
        for arm, part in zip(ARMS, v.reshape(len(ARMS), layout.ARM_KEYPOSE_DIM), strict=True):
            if np.linalg.norm(part[layout.QUATERNION]) < 1e-6:
                raise InvalidAction(f"keypose action has a zero quaternion for the {arm} arm")
            pose = Pose(part[layout.POSITION], quat_wxyz_canonical(part[layout.QUATERNION]))
            is_open, ignores = part[[layout.GRIPPER_OPEN, layout.IGNORE_COLLISIONS]] > 0.5
            targets.append(Keypose(pose, bool(is_open), bool(ignores)))
        return cls(*targets)
