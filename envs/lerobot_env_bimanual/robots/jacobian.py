"""Hand pose and Jacobian of many postures of a Franka arm at once."""

import itertools

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import JOINTS_PER_ARM

Array = NDArray[np.floating]

# Modified Denavit-Hartenberg parameters as published by the arm's maker: how each joint's frame lies in the last.
_TWIST_RAD = np.array([0.0, -0.5, 0.5, 0.5, -0.5, 0.5, 0.5]) * np.pi
_OFFSET_M = np.array([0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088])
_DISTANCE_M = np.array([0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0])
_JOINT7_TO_TCP_M = 0.107 + 0.1034
"""From joint 7 to the flange, and from there to the hand's tool centre point."""
_HAND_YAW_RAD = -np.pi / 4
"""The hand is mounted turned about the flange's axis."""


def hand_frames(joints: Array) -> tuple[Array, Array]:
    """Poses and Jacobians of the tool centre point in the arm's base frame.

    Args:
        joints: (n, 7) rad.

    Returns:
        Poses (n, 4, 4) and the Jacobian (n, 6, 7): linear over angular velocity per joint velocity.
    """
    sine, cosine = (function(joints.T)[..., None, None] for function in (np.sin, np.cos))
    frames = _CONSTANT + sine * _TIMES_SINE + cosine * _TIMES_COSINE  # (7, n, 4, 4), each in the last joint's
    for before, frame in itertools.pairwise(frames):
        np.matmul(before, frame, out=frame)
    hand = frames[-1] @ _JOINT7_T_TCP

    axis = frames[..., :3, 2].transpose(2, 1, 0)  # (3, n, 7)
    lever = hand[:, :3, 3].T[..., None] - frames[..., :3, 3].transpose(2, 1, 0)
    jacobian = np.empty((len(joints), 6, JOINTS_PER_ARM))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        jacobian[:, i] = axis[j] * lever[k] - axis[k] * lever[j]
        jacobian[:, 3 + i] = axis[i]
    return hand, jacobian


def _joint_frames() -> tuple[Array, Array, Array]:
    """What is constant, goes with the sine and with the cosine of the angle in each joint's frame, (7, 1, 4, 4)."""
    constant, sine, cosine = np.zeros((3, JOINTS_PER_ARM, 1, 4, 4))
    sine_twist, cosine_twist = np.sin(_TWIST_RAD), np.cos(_TWIST_RAD)
    cosine[:, 0, 0, 0], sine[:, 0, 0, 1] = 1.0, -1.0
    sine[:, 0, 1, 0] = cosine[:, 0, 1, 1] = cosine_twist
    sine[:, 0, 2, 0] = cosine[:, 0, 2, 1] = sine_twist
    constant[:, 0, 1, 2], constant[:, 0, 2, 2] = -sine_twist, cosine_twist
    constant[:, 0, 0, 3] = _OFFSET_M
    constant[:, 0, 1, 3], constant[:, 0, 2, 3] = -sine_twist * _DISTANCE_M, cosine_twist * _DISTANCE_M
    constant[:, 0, 3, 3] = 1.0
    return constant, sine, cosine


_CONSTANT, _TIMES_SINE, _TIMES_COSINE = _joint_frames()
_SINE, _COSINE = np.sin(_HAND_YAW_RAD), np.cos(_HAND_YAW_RAD)
_JOINT7_T_TCP = np.array(
    [[_COSINE, -_SINE, 0, 0], [_SINE, _COSINE, 0, 0], [0, 0, 1, _JOINT7_TO_TCP_M], [0, 0, 0, 1]]
)
