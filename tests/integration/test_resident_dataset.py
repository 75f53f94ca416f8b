"""Batches from memory are those of the dataset."""

import pytest
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch.utils.data import default_collate

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual.training import resident_dataset
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset


@pytest.fixture(params=schema.VIEWS)
def stored(request, generated) -> LeRobotDataset:
    return LeRobotDataset("local/small", root=generated / request.param, return_uint8=True)


CPU = torch.device("cpu")


def as_lerobot_trains(batch: dict, colour_keys: set[str]) -> dict:
    """What LeRobot's training loop does to a batch before the policy's preprocessor."""
    integers = {key for key in colour_keys if not batch[key].is_floating_point()}
    return batch | {key: batch[key].float() / 255 for key in integers}


def test_every_batch_is_the_one_that_lerobot_trains_on(stored):
    held = ResidentDataset(stored, CPU)
    assert len(held) == len(stored) == held.num_frames
    rows = torch.randperm(len(stored)).tolist()
    for start in range(0, len(rows), 3):
        chosen = rows[start : start + 3]
        batch = held.batch(default_collate([held[row] for row in chosen]))
        expected = default_collate([stored[row] for row in chosen])
        expected = as_lerobot_trains(expected, set(stored.meta.camera_keys) - set(stored.meta.depth_keys))
        assert batch.keys() == expected.keys()
        for key, value in expected.items():
            assert type(batch[key]) is type(value)
            if isinstance(value, torch.Tensor):
                assert batch[key].dtype == value.dtype
                assert torch.equal(batch[key], value)
            else:
                assert batch[key] == value


def test_a_dataset_larger_than_the_memory_is_refused(stored, monkeypatch):
    monkeypatch.setattr(resident_dataset, "MAX_SHARE", 1e-9)
    with pytest.raises(DatasetError, match=r"rows of this dataset take .* GB of memory"):
        ResidentDataset(stored, CPU)
