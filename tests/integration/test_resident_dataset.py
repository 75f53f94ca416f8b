"""Batches from memory are those of the dataset."""

from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from lerobot.configs.default import DatasetConfig
from lerobot.configs.train import TrainPipelineConfig
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.transforms import ImageTransformsConfig
from torch.utils.data import default_collate

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual.training import resident_dataset, train
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset
from lerobot_policy_bimanual.training.train import AcceleratorWithMemory, check_training, input_image_keys

CPU = torch.device("cpu")
LEARNT_WITH = {
    "each row alone": {},
    "a chunk of actions": {schema.ACTION: [0, 1, 2, 3, 4, 5, 6]},
    "what was seen before": {
        schema.ACTION: [-1, 0, 1],
        schema.STATE: [-2, 0],
        schema.image_key("front"): [-3, -1, 0],
        schema.depth_key("left_wrist"): [-1, 0],
        schema.image_key("left_wrist"): [0],
    },
}
"""Cases by name: for each column, the offsets of the rows that are loaded with a row."""


def stored_in(root: Path, view: schema.View, offsets: dict[str, list[int]], **options) -> LeRobotDataset:
    """A view as LeRobot loads it for training."""
    seconds = {key: [row / feature_table.FPS[view] for row in rows] for key, rows in offsets.items()}
    options |= {"return_uint8": True, "delta_timestamps": seconds or None}
    return LeRobotDataset("local/small", root=root / view, **options)


def assert_same_batches(held: ResidentDataset, stored: LeRobotDataset, rows: list[int], left_out=()) -> None:
    """Every batch of three of these rows is equal to the bit, but for keys that are left out of it."""
    colour_keys = {*stored.meta.camera_keys} - {*stored.meta.depth_keys}
    for start in range(0, len(rows), 3):
        chosen = rows[start : start + 3]
        batch = held.batch(default_collate([held[row] for row in chosen]))
        expected = default_collate([stored[row] for row in chosen])
        colours = [key for key in colour_keys if not expected[key].is_floating_point()]
        expected |= {key: expected[key].float() / 255 for key in colours}  # as LeRobot's training loop does
        expected = {key: value for key, value in expected.items() if key not in left_out}
        assert batch.keys() == expected.keys()
        for key, value in expected.items():
            assert type(batch[key]) is type(value)
            if isinstance(value, torch.Tensor):
                assert batch[key].dtype == value.dtype
                assert torch.equal(batch[key], value)
            else:
                assert batch[key] == value


@pytest.mark.parametrize("view", schema.VIEWS)
@pytest.mark.parametrize("offsets", LEARNT_WITH.values(), ids=LEARNT_WITH)
def test_every_batch_is_the_one_that_lerobot_trains_on(generated, view, offsets):
    stored = stored_in(generated, view, offsets)
    held = ResidentDataset(stored, CPU)
    assert len(held) == len(stored)
    ends = {0, 1, len(stored) - 1} | {int(row) for row in held._last} | {int(row) for row in held._first}
    others = set(torch.randperm(len(stored))[:9].tolist())
    assert_same_batches(held, stored, sorted(ends | others))


@pytest.mark.parametrize("view", schema.VIEWS)
def test_chosen_episodes_are_learnt_with_their_own_rows_and_unread_images_are_not_decoded(generated, view):
    stored = stored_in(generated, view, LEARNT_WITH["a chunk of actions"], episodes=[1])
    assert stored[0]["index"] > 0
    front = schema.image_key("front")
    held = ResidentDataset(stored, CPU, images={front})
    left_out = set(stored.meta.camera_keys) - {front}
    assert left_out.isdisjoint(held._columns)
    assert_same_batches(held, stored, [0, len(stored) // 2, len(stored) - 1], left_out)


def test_a_policy_reads_the_images_that_it_names_and_all_if_it_names_none(generated):
    meta = stored_in(generated, "keyframes", {}).meta
    front = schema.image_key("front")
    seen = PolicyFeature(FeatureType.VISUAL, (3, 32, 32))

    def read(renamed: dict[str, str], *inputs: str) -> set[str]:
        policy = ACTConfig(input_features=dict.fromkeys(inputs, seen), device="cpu")
        return input_image_keys(SimpleNamespace(policy=policy, rename_map=renamed), meta)

    assert read({}) == set(meta.camera_keys)
    assert read({}, front) == {front}
    assert read({front: "observation.images.camera1"}, "observation.images.camera1") == {front}


@pytest.mark.parametrize(
    ("option", "value"),
    [("streaming", True), ("image_transforms", ImageTransformsConfig(True)), ("depth_output_unit", "m")],
)
def test_rows_that_memory_cannot_hold_as_requested_are_refused_by_flag(option, value, generated):
    dataset = DatasetConfig("local/small", root=str(generated / "keyframes"), **{option: value})
    with pytest.raises(DatasetError, match=rf"--dataset\.{option}.*`lerobot-train`"):
        check_training(TrainPipelineConfig(dataset))


def test_depth_is_not_given_to_a_policy_that_takes_it_for_colours(generated):
    dataset = DatasetConfig("local/small", root=str(generated / "keyframes"))
    with pytest.raises(DatasetError, match=r"'act' would take the depth .* --depth=false"):
        check_training(TrainPipelineConfig(dataset, policy=ACTConfig(device="cpu")))


def test_images_of_another_size_than_a_config_names_are_refused(generated):
    dataset = DatasetConfig("local/small", root=str(generated / "frames"))
    named = {"observation.images.front": PolicyFeature(FeatureType.VISUAL, (3, 128, 128))}
    with pytest.raises(DatasetError, match="is 24x32, but 128x128 in the policy's input_features"):
        check_training(TrainPipelineConfig(dataset, policy=ACTConfig(device="cpu", input_features=named)))


def test_an_attribute_error_while_the_accelerator_is_made_names_the_missing_attribute(monkeypatch):
    monkeypatch.setattr(train, "check_training", lambda cfg: cfg.missing)
    with pytest.raises(AttributeError, match="'missing'"):
        AcceleratorWithMemory(SimpleNamespace(), SimpleNamespace, None).autocast()


def test_depth_is_rounded_to_16_bits_and_a_dataset_larger_than_the_memory_is_refused(generated, monkeypatch):
    stored = stored_in(generated, "keyframes", {})
    held, key = ResidentDataset(stored, CPU), schema.depth_key("front")
    depth_mm = torch.tensor([0.4, 1.5, 999.9, 65535.0, 70000.0, -3.0])
    assert held._unpacked(key, held._packed(key, depth_mm)).tolist() == [0, 2, 1000, 65535, 65535, 0]
    monkeypatch.setattr(resident_dataset, "MAX_SHARE", 1e-9)
    with pytest.raises(DatasetError, match=r"rows of this dataset take .* GB of memory"):
        ResidentDataset(stored, CPU)
