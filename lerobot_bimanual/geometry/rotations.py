"""Rotation conversions in NumPy, batched over leading dimensions.

One naming rule, `a_to_b`. Quaternions are wxyz. Euler angles are extrinsic xyz (rotations about the fixed
world axes x, then y, then z), in radians: the convention of PerAct's 72-bin rotation head. The functions of
`rotations_torch` have the same names and are tested to agree.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Below this cosine of the pitch the first and third Euler angles describe the same turn (6e-5 deg from 90 deg).
SINGULAR_COSINE = 1e-6

# The C library's: NumPy's own differs between processors in the last bit.
_arctan2 = np.vectorize(math.atan2, otypes=[np.float64])


def quat_wxyz_canonical(quat_wxyz: ArrayLike) -> Array:
    """Unit quaternion with w >= 0, so that equal rotations have equal numbers; shape (..., 4).

    Along a continuous motion the signs flip where the angle passes 180 degrees: to subtract two, compare both signs.
    """
    q = np.asarray(quat_wxyz, dtype=np.float64)
    if q.ndim == 1:  # an order of magnitude faster without arrays
        w, x, y, z = q.tolist()
        length = math.sqrt(w * w + x * x + y * y + z * z)
        return q / (-length if w < 0 else length)
    q = q / np.sqrt(np.square(q).sum(axis=-1, keepdims=True))
    return np.where(q[..., :1] < 0, -q, q)


def quat_wxyz_conjugate(quat_wxyz: ArrayLike) -> Array:
    """Inverse rotation of unit quaternions; shape (..., 4)."""
    return np.asarray(quat_wxyz, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def quat_wxyz_multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Hamilton product: the rotation `b` followed by `a`; shapes broadcast, (..., 4)."""
    aw, ax, ay, az = _components(a)
    bw, bx, by, bz = _components(b)
    return _joined(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        )
    )


def quat_wxyz_to_matrix(quat_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = _components(quat_wxyz)
    elements = (
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return _joined(elements).reshape(*np.shape(w), 3, 3)


def matrix_to_quat_wxyz(matrix: ArrayLike) -> Array:
    """Canonical quaternions (..., 4) of rotation matrices (..., 3, 3).

    Of the four classical formulas the one with the largest divisor is taken, so the result is accurate for
    every rotation angle.
    """
    m = np.asarray(matrix, dtype=np.float64)
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = _components(m.reshape(*m.shape[:-2], 9))
    # Squared components times four; each row of `products` is q scaled by four times one of its components.
    ww, xx, yy, zz = 1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22
    wx, wy, wz = m21 - m12, m02 - m20, m10 - m01
    xy, xz, yz = m01 + m10, m02 + m20, m12 + m21
    squares = (ww, xx, yy, zz)
    rows = ((ww, wx, wy, wz), (wx, xx, xy, xz), (wy, xy, yy, yz), (wz, xz, yz, zz))
    if m.ndim == 2:
        return quat_wxyz_canonical(rows[squares.index(max(squares))])
    products = _joined([number for row in rows for number in row]).reshape(*m.shape[:-2], 4, 4)
    largest = np.argmax(_joined(squares), axis=-1)
    return quat_wxyz_canonical(np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :])


def quat_wxyz_to_euler_xyz(quat_wxyz: ArrayLike) -> Array:
    """Extrinsic xyz Euler angles (..., 3) in radians: x and z in [-pi, pi], y in [-pi/2, pi/2].

    At pitch +-90 degrees x and z turn about the same line; the third angle is then set to 0, so that equal
    rotations have equal angles and a classifier over their bins has one right answer.
    """
    m = quat_wxyz_to_matrix(quat_wxyz)
    cosine = np.hypot(m[..., 0, 0], m[..., 1, 0])
    pitch = _arctan2(-m[..., 2, 0], cosine)
    singular = cosine < SINGULAR_COSINE
    roll = np.where(singular, _arctan2(-m[..., 1, 2], m[..., 1, 1]), _arctan2(m[..., 2, 1], m[..., 2, 2]))
    yaw = np.where(singular, 0.0, _arctan2(m[..., 1, 0], m[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1)


def euler_xyz_to_quat_wxyz(euler_rad: ArrayLike) -> Array:
    """Canonical quaternions (..., 4) of extrinsic xyz Euler angles (..., 3) in radians."""
    half = np.asarray(euler_rad, dtype=np.float64) / 2
    (cx, cy, cz), (sx, sy, sz) = _components(np.cos(half)), _components(np.sin(half))
    # (cz + sz k) (cy + sy j) (cx + sx i), written out.
    return quat_wxyz_canonical(
        _joined(
            (
                cx * cy * cz + sx * sy * sz,
                sx * cy * cz - cx * sy * sz,
                cx * sy * cz + sx * cy * sz,
                cx * cy * sz - sx * sy * cz,
            )
        )
    )


def quat_wxyz_from_axis_angle(axis: ArrayLike, angle_rad: ArrayLike) -> Array:
    """Quaternions (..., 4) turning by `angle_rad` (...,) about `axis` (..., 3), of any length but zero."""
    direction = np.asarray(axis, dtype=np.float64)
    if direction.ndim == 1 and np.ndim(angle_rad) == 0:
        half_rad = float(angle_rad) / 2  # pyright: ignore[reportArgumentType]
        x, y, z = direction.tolist()
        scale = math.sin(half_rad) / math.sqrt(x * x + y * y + z * z)
        return np.array((math.cos(half_rad), scale * x, scale * y, scale * z))
    direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    half: Array = np.asarray(angle_rad, dtype=np.float64)[..., None] / 2
    vector = np.sin(half) * direction
    scalar = np.broadcast_to(np.cos(half), (*vector.shape[:-1], 1))
    return np.concatenate([scalar, vector], axis=-1)


def quat_wxyz_to_rotation_vector(quat_wxyz: ArrayLike) -> Array:
    """Axis times angle (..., 3) in radians, angle in [0, pi]."""
    q = quat_wxyz_canonical(quat_wxyz)
    if q.ndim == 1:
        w, x, y, z = q.tolist()
        length = math.sqrt(x * x + y * y + z * z)
        scale = 2 * math.atan2(length, w) / length if length > 1e-12 else 2.0
        return np.array((scale * x, scale * y, scale * z))
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * _arctan2(sine, q[..., :1])
    # angle / sine tends to 2 as the rotation vanishes.
    return q[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)


def rotation_vector(matrix: ArrayLike) -> Array:
    """Axis times angle (..., 3) in radians of rotation matrices (..., 3, 3)."""
    return quat_wxyz_to_rotation_vector(matrix_to_quat_wxyz(matrix))


def rotation_angle_rad(a: ArrayLike, b: ArrayLike) -> Array:
    """Angle in [0, pi] between the rotations of two quaternions (..., 4)."""
    difference = quat_wxyz_multiply(b, quat_wxyz_conjugate(a))
    return np.linalg.norm(quat_wxyz_to_rotation_vector(difference), axis=-1)


def _components(vectors: ArrayLike) -> Any:
    """The numbers of vectors (..., n): n arrays (...,), or n floats of a single vector, which is much faster."""
    v = np.asarray(vectors, dtype=np.float64)
    return v.tolist() if v.ndim == 1 else [v[..., i] for i in range(v.shape[-1])]


def _joined(components: Sequence[Any]) -> Array:
    """Vectors (..., n) of what `_components` takes apart."""
    v = np.array(components)
    return v if v.ndim == 1 else v.transpose(*range(1, v.ndim), 0)
