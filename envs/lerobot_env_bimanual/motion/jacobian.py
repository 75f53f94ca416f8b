"""Hand pose and Jacobian of many postures of a Franka arm at once.

Dimensions are the published modified Denavit-Hartenberg parameters of the arm and its hand. Arrays of vectors
have their components first, (3, n), so that each operation is one call over all postures.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

SHOULDER_HEIGHT_M = 0.333
UPPER_ARM_M = 0.316
ELBOW_OFFSET_M = 0.0825
FOREARM_M = 0.384
WRIST_OFFSET_M = 0.088
WRIST_TO_TCP_M = 0.107 + 0.1034
"""Flange beyond joint 7, and the hand's tool centre point beyond the flange."""
HAND_YAW_RAD = -np.pi / 4
"""The hand is mounted turned about the flange's axis."""


def hand_frames(joints: Array) -> tuple[Array, Array, Array]:
    """Poses and Jacobians of the tool centre point in the arm's base frame.

    Args:
        joints: (n, 7) rad.

    Returns:
        Axes of the hand (3 axes, 3 components, n), its position (3, n) in m, and the Jacobian (n, 6, 7):
        linear over angular velocity per joint velocity.
    """
    sine, cosine = np.sin(joints.T), np.cos(joints.T)
    z1 = np.zeros((3, len(joints)))
    z1[2] = 1.0
    x1, z2 = np.zeros_like(z1), np.zeros_like(z1)
    x1[0], x1[1] = cosine[0], sine[0]
    z2[0], z2[1] = -sine[0], cosine[0]
    # Each joint turns two axes of the frame before it; the next joint's axis is one of the turned ones.
    z3, x2 = _turn(z1, x1, sine[1], cosine[1])
    x3, y3 = _turn(x2, z2, sine[2], cosine[2])
    x4, z5 = _turn(x3, z3, sine[3], cosine[3])
    z4 = -y3
    x5, y5 = _turn(x4, y3, sine[4], cosine[4])
    z6 = -y5
    x6, y6 = _turn(x5, z5, sine[5], cosine[5])
    z7 = -y6
    x7, y7 = _turn(x6, z6, sine[6], cosine[6])
    x, y = _turn(x7, y7, np.sin(HAND_YAW_RAD), np.cos(HAND_YAW_RAD))

    shoulder = SHOULDER_HEIGHT_M * z1
    elbow = shoulder + UPPER_ARM_M * z3 + ELBOW_OFFSET_M * x3
    wrist = elbow - ELBOW_OFFSET_M * x4 + FOREARM_M * z5
    joint7 = wrist + WRIST_OFFSET_M * x6
    position = joint7 + WRIST_TO_TCP_M * z7

    axes = np.stack([z1, z2, z3, z4, z5, z6, z7])
    lever = position - np.stack([shoulder, shoulder, shoulder, elbow, wrist, wrist, joint7])
    jacobian = np.empty((len(joints), 6, 7))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        jacobian[:, i] = (axes[:, j] * lever[:, k] - axes[:, k] * lever[:, j]).T
    jacobian[:, 3:] = axes.transpose(2, 1, 0)
    return np.stack([x, y, z7]), position, jacobian


def _turn(a: Array, b: Array, sine: Array | float, cosine: Array | float) -> tuple[Array, Array]:
    """Two orthogonal axes (3, n) turned in their plane."""
    return cosine * a + sine * b, cosine * b - sine * a
