"""Rigid poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry import rotations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid pose, or the transform from its own frame to the frame it is given in.

    Attributes:
        position: (3,) metres.
        quat_wxyz: (4,) unit quaternion.
    """

    position: Array
    quat_wxyz: Array

    def __post_init__(self):
        """Copy both arrays as float64, so that a pose never aliases simulator memory."""
        object.__setattr__(self, "position", np.array(self.position, dtype=np.float64))
        object.__setattr__(self, "quat_wxyz", np.array(self.quat_wxyz, dtype=np.float64))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> "Pose":
        """Pose of a (4, 4) homogeneous matrix."""
        m = np.asarray(matrix, dtype=np.float64)
        return cls(m[:3, 3], rotations.matrix_to_quat_wxyz(m[:3, :3]))

    @classmethod
    def upright(cls, position: ArrayLike, yaw_rad: float = 0.0) -> "Pose":
        """Pose turned by `yaw_rad` about the vertical axis."""
        return cls(np.asarray(position), rotations.quat_wxyz_from_axis_angle([0, 0, 1], yaw_rad))

    @classmethod
    def looking(cls, position: ArrayLike, approach: ArrayLike, opening: ArrayLike) -> "Pose":
        """Hand pose from directions.

        Args:
            position: (3,) metres, between the fingertips.
            approach: (3,) direction out of the palm: the hand frame's z axis.
            opening: (3,) direction along which the fingers open: the hand frame's y axis, made orthogonal
                to `approach`.

        Raises:
            BimanualError: one of the directions is zero, or both are parallel.
        """
        z = np.asarray(approach, dtype=np.float64)
        z = z / np.linalg.norm(z)
        y = np.asarray(opening, dtype=np.float64)
        y = y - z * (y @ z)
        if not (length := np.linalg.norm(y)) > 1e-9:
            raise BimanualError(
                f"opening {opening} is zero or along the approach {approach}, but must be across it"
            )
        y = y / length
        x = y[[1, 2, 0]] * z[[2, 0, 1]] - y[[2, 0, 1]] * z[[1, 2, 0]]  # np.cross, ten times as fast
        matrix = np.stack([x, y, z], axis=-1)
        return cls(np.asarray(position), rotations.matrix_to_quat_wxyz(matrix))

    @property
    def rotation(self) -> Array:
        """Rotation matrix (3, 3)."""
        return rotations.quat_wxyz_to_matrix(self.quat_wxyz)

    @property
    def matrix(self) -> Array:
        """Homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.position
        return matrix

    def __matmul__(self, other: "Pose") -> "Pose":
        """Compose: `world_T_a @ a_T_b` is `world_T_b`."""
        return Pose(
            self.apply(other.position),
            rotations.quat_wxyz_canonical(rotations.quat_wxyz_multiply(self.quat_wxyz, other.quat_wxyz)),
        )

    def inverse(self) -> "Pose":
        """The transform back."""
        conjugate = rotations.quat_wxyz_conjugate(self.quat_wxyz)
        return Pose(-rotations.quat_wxyz_to_matrix(conjugate) @ self.position, conjugate)

    def apply(self, points: ArrayLike) -> Array:
        """Points (..., 3) of this frame, in the outer frame."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.position

    def translated(self, offset: ArrayLike) -> "Pose":
        """The same orientation, moved by `offset` (3,) metres in the outer frame."""
        return Pose(self.position + np.asarray(offset, dtype=np.float64), self.quat_wxyz)

    def advanced(self, distance_m: float) -> "Pose":
        """Moved along its own z axis: for a hand pose, `distance_m` further in the approach direction."""
        return self.translated(self.rotation[:, 2] * distance_m)

    def distance_to(self, other: "Pose") -> tuple[float, float]:
        """Distance in metres and rotation angle in radians."""
        return (
            float(np.linalg.norm(other.position - self.position)),
            float(rotations.rotation_angle_rad(self.quat_wxyz, other.quat_wxyz)),
        )
