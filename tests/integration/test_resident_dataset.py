"""Rows in memory are those of the dataset."""

import pytest
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual.training import resident_dataset
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset


@pytest.fixture(params=schema.VIEWS)
def stored(request, generated) -> LeRobotDataset:
    return LeRobotDataset("local/small", root=generated / request.param, return_uint8=True)


def test_every_row_is_the_stored_one_but_for_the_type_of_colours(stored):
    held = ResidentDataset(stored)
    assert len(held) == len(stored) == held.num_frames
    for index in range(len(stored)):
        row, expected = held[index], stored[index]
        assert list(row) == list(expected)
        for key, value in expected.items():
            if key in stored.meta.camera_keys and key not in stored.meta.depth_keys:
                assert row[key].dtype == torch.uint8
                as_lerobot_trains = row[key].float() / 255
                assert torch.equal(
                    as_lerobot_trains, value if value.is_floating_point() else value.float() / 255
                )
            elif isinstance(value, torch.Tensor):
                assert row[key].dtype == value.dtype
                assert torch.equal(row[key], value)
            else:
                assert row[key] == value


def test_a_dataset_larger_than_the_memory_is_refused(stored, monkeypatch):
    monkeypatch.setattr(resident_dataset, "MAX_SHARE", 1e-9)
    with pytest.raises(DatasetError, match=r"rows of this dataset take .* GB of memory"):
        ResidentDataset(stored)
