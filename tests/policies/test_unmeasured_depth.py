"""Pixels whose depth was not measured are no points, whether they say 0, NaN or the nearest that a dataset stores."""

import pytest
import torch

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.cameras_torch import unproject
from lerobot_bimanual.dataset import schema
from lerobot_policy_bimanual.keypose.observation import observe


@pytest.mark.parametrize("nothing", [0.0, torch.nan, 10.0])
def test_what_was_not_measured_is_no_point(make_batch, nothing):
    batch = make_batch()
    key = schema.depth_key("front")
    is_lost = torch.zeros_like(batch[key], dtype=torch.bool)
    is_lost[..., 3:7, 2:9] = True
    whole = observe(batch, cameras=("front",), keypose_horizon=5).points
    batch[key] = torch.where(is_lost, nothing, batch[key])
    points = observe(batch, cameras=("front",), keypose_horizon=5).points
    lost = is_lost.flatten(2).expand_as(points)
    assert points[lost].isnan().all()
    assert torch.equal(points[~lost], whole[~lost])


def test_what_was_measured_is_where_it_was_bit_for_bit(make_batch):
    batch = make_batch()
    for camera in CAMERA_NAMES:
        index, depth_mm = CAMERA_NAMES.index(camera), batch[schema.depth_key(camera)]
        batch[schema.depth_key(camera)] = depth_mm.clamp(min=11)  # the next that a dataset can store
        expected = unproject(
            batch[schema.depth_key(camera)][:, 0] / 1000,
            batch[schema.CAMERA_INTRINSICS].unflatten(-1, (5, 3, 3))[:, index],
            batch[schema.CAMERA_EXTRINSICS].unflatten(-1, (5, 4, 4))[:, index],
        )
        assert torch.equal(observe(batch, cameras=(camera,), keypose_horizon=5).points, expected)
