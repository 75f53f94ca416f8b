"""scripts/chunk_errors.py measures what it says, also of a policy that has learnt nothing."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors

from lerobot_bimanual.dataset import schema

ROOT = Path(__file__).parents[2]
FRONT = schema.image_key("front")


@pytest.fixture
def script():
    spec = importlib.util.spec_from_file_location("chunk_errors", ROOT / "scripts/chunk_errors.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def untrained(generated: Path, tmp_path: Path) -> Path:
    """A tiny ACT as LeRobot saves it."""
    torch.manual_seed(0)
    meta = LeRobotDataset("local/small", root=generated / "frames").meta
    height, width, channels = meta.features[FRONT]["shape"]
    config = ACTConfig(
        input_features={
            FRONT: PolicyFeature(FeatureType.VISUAL, (channels, height, width)),
            schema.STATE: PolicyFeature(FeatureType.STATE, (16,)),
        },
        output_features={schema.ACTION: PolicyFeature(FeatureType.ACTION, (16,))},
        chunk_size=10,
        n_action_steps=10,
        dim_model=16,
        n_heads=2,
        dim_feedforward=32,
        n_encoder_layers=1,
        use_vae=False,
        pretrained_backbone_weights=None,
        device="cpu",
    )
    ACTPolicy(config).save_pretrained(tmp_path)
    for processor in make_pre_post_processors(config, dataset_stats=meta.stats):
        processor.save_pretrained(tmp_path)
    return tmp_path


def test_errors_are_those_of_the_hands_and_other_images_make_a_difference(script, generated, untrained):
    first, errors_cm = script.measure(untrained, generated / "frames", [0, 9])
    lengths = np.diff([*np.flatnonzero(first), len(first)])
    assert len(lengths) > 1
    for errors in errors_cm.values():
        assert errors.shape == (len(first), 2)
        # An episode's last nine rows have no tick 9.
        assert np.isnan(errors).sum(axis=0).tolist() == [0, 9 * len(lengths)]
        assert np.nanmin(errors) >= 0
    assert errors_cm["still"][first, 0].max() < 3  # hands start at rest
    assert np.nanmean(errors_cm["still"][:, 1]) > np.nanmean(errors_cm["still"][:, 0])
    assert not np.array_equal(errors_cm["policy"], errors_cm["policy, other images"], equal_nan=True)


def test_images_are_those_of_the_next_episode(script, generated):
    stored = LeRobotDataset("local/small", root=generated / "frames")
    episode = np.array(stored.hf_dataset["episode_index"])
    other = script.elsewhere(stored, torch.arange(len(stored))).numpy()
    assert np.array_equal(episode[other], (episode + 1) % (episode.max() + 1))
    starts = np.flatnonzero(np.diff(episode, prepend=-1))
    assert set(starts) <= set(other[starts])
