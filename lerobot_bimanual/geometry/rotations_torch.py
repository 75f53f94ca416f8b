"""The rotation conversions of `rotations`, on batched torch tensors (same names, same conventions)."""

import torch
from torch import Tensor

from lerobot_bimanual.geometry.rotations import SINGULAR_COSINE


def quat_wxyz_canonical(quat_wxyz: Tensor) -> Tensor:
    """Unit quaternion with w >= 0; shape (..., 4)."""
    q = quat_wxyz / quat_wxyz.norm(dim=-1, keepdim=True)
    return torch.where(q[..., :1] < 0, -q, q)


def quat_wxyz_conjugate(quat_wxyz: Tensor) -> Tensor:
    """Inverse rotation of unit quaternions; shape (..., 4)."""
    return quat_wxyz * quat_wxyz.new_tensor([1.0, -1.0, -1.0, -1.0])


def quat_wxyz_multiply(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product: the rotation `b` followed by `a`; shapes broadcast, (..., 4)."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        dim=-1,
    )


def quat_wxyz_to_matrix(quat_wxyz: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = quat_wxyz.unbind(-1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def matrix_to_quat_wxyz(matrix: Tensor) -> Tensor:
    """Canonical quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = matrix.flatten(-2).unbind(-1)
    ww, xx, yy, zz = 1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22
    wx, wy, wz = m21 - m12, m02 - m20, m10 - m01
    xy, xz, yz = m01 + m10, m02 + m20, m12 + m21
    rows = ((ww, wx, wy, wz), (wx, xx, xy, xz), (wy, xy, yy, yz), (wz, xz, yz, zz))
    products = torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
    largest = torch.stack([ww, xx, yy, zz], dim=-1).argmax(dim=-1)[..., None, None]
    return quat_wxyz_canonical(products.take_along_dim(largest, dim=-2)[..., 0, :])


def quat_wxyz_to_euler_xyz(quat_wxyz: Tensor) -> Tensor:
    """Extrinsic xyz Euler angles (..., 3) in radians, third angle 0 at the singularity."""
    m = quat_wxyz_to_matrix(quat_wxyz)
    cosine = torch.hypot(m[..., 0, 0], m[..., 1, 0])
    pitch = torch.atan2(-m[..., 2, 0], cosine)
    # In float32 the rounding of the matrix moves the cosine by a few 1e-7 near zero; the limit leaves a wide margin.
    singular = cosine < max(SINGULAR_COSINE, torch.finfo(quat_wxyz.dtype).eps ** 0.5)
    roll = torch.where(
        singular, torch.atan2(-m[..., 1, 2], m[..., 1, 1]), torch.atan2(m[..., 2, 1], m[..., 2, 2])
    )
    yaw = torch.where(singular, torch.zeros_like(pitch), torch.atan2(m[..., 1, 0], m[..., 0, 0]))
    return torch.stack([roll, pitch, yaw], dim=-1)


def euler_xyz_to_quat_wxyz(euler_rad: Tensor) -> Tensor:
    """Canonical quaternions (..., 4) of extrinsic xyz Euler angles (..., 3) in radians."""
    (cx, cy, cz), (sx, sy, sz) = (euler_rad / 2).cos().unbind(-1), (euler_rad / 2).sin().unbind(-1)
    # (cz + sz k) (cy + sy j) (cx + sx i), written out.
    parts = (
        cx * cy * cz + sx * sy * sz,
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
    )
    return quat_wxyz_canonical(torch.stack(parts, dim=-1))


def rotation_angle_rad(a: Tensor, b: Tensor) -> Tensor:
    """Angle in [0, pi] between the rotations of two unit quaternions (..., 4)."""
    difference = quat_wxyz_canonical(quat_wxyz_multiply(b, quat_wxyz_conjugate(a)))
    return 2 * torch.atan2(difference[..., 1:].norm(dim=-1), difference[..., 0])
