"""Pinhole geometry: projection and unprojection are inverse, and NumPy and torch agree."""

import numpy as np
import torch

from lerobot_bimanual import cameras, cameras_torch
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical

HEIGHT, WIDTH = 12, 16
INTRINSICS = cameras.intrinsics_from_fovy(np.deg2rad(60), HEIGHT, WIDTH)
WORLD_T_CAMERA = Pose(np.array([0.3, -0.2, 1.1]), quat_wxyz_canonical([0.2, 0.5, -0.3, 0.7])).matrix


def random_depth(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.2, 3.0, size=(HEIGHT, WIDTH))


def test_field_of_view_spans_the_image_height():
    top, bottom = ([0.0, y, 1.0] for y in (-np.tan(np.deg2rad(30)), np.tan(np.deg2rad(30))))
    rows = cameras.project(np.array([top, bottom]), INTRINSICS, np.eye(4))[:, 1]
    np.testing.assert_allclose(rows, [0.0, HEIGHT], atol=1e-9)


def test_unprojected_pixels_project_back_to_their_centres_and_depth():
    depth = random_depth()
    pixels = cameras.project(cameras.unproject(depth, INTRINSICS, WORLD_T_CAMERA), INTRINSICS, WORLD_T_CAMERA)
    rows, columns = np.meshgrid(np.arange(HEIGHT) + 0.5, np.arange(WIDTH) + 0.5, indexing="ij")
    np.testing.assert_allclose(pixels[..., 0], columns, atol=1e-9)
    np.testing.assert_allclose(pixels[..., 1], rows, atol=1e-9)
    np.testing.assert_allclose(pixels[..., 2], depth, atol=1e-12)


def test_invalid_depth_becomes_nan():
    depth = random_depth()
    depth[0, :4] = [0.0, -1.0, np.nan, np.inf]
    points = cameras.unproject(depth, INTRINSICS, WORLD_T_CAMERA)
    assert np.isnan(points[0, :4]).all()
    assert np.isfinite(points[1:]).all()


def test_torch_unprojection_agrees_for_a_batch_of_cameras():
    depths = np.stack([random_depth(seed) for seed in range(3)])
    depths[1, 2, 3] = 0.0
    transforms = np.stack([WORLD_T_CAMERA, np.eye(4), np.linalg.inv(WORLD_T_CAMERA)])
    expected = np.stack(
        [cameras.unproject(d, INTRINSICS, t) for d, t in zip(depths, transforms, strict=True)]
    )
    got = cameras_torch.unproject(
        torch.from_numpy(depths),
        torch.from_numpy(np.stack([INTRINSICS] * 3)),
        torch.from_numpy(transforms),
    )
    np.testing.assert_allclose(got.mT.numpy(), expected.reshape(3, -1, 3), atol=1e-9)
