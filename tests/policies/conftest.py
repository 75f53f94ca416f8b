"""Batches and configs for the policy tests."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

LOOKING_DOWN = torch.tensor([[0.0, -1, 0, 0.2], [-1, 0, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]])
"""world_T_camera of a camera two metres above the floor, over the workspace's centre."""

TINY = {
    **{"device": "cpu", "keypose_horizon": 25, "channels": 8, "token_dim": 16, "depth": 2, "heads": 2},
    **{"feedforward_multiplier": 2, "attention_dropout": 0.0, "language_tokens": 4, "language_dim": 16},
}
TINY_PERACT = TINY | {"voxel_size": 10, "num_latents": 16, "latent_dim": 32}
"""Sizes of the smallest PerAct with every part in it."""

FACTORISED = {"translation_head": "factorised", "voxel_cells": 3, "projection_dilations": (2,)}
FACTORISED |= {"language_filters": True, "quadratic_features": True}
TINY_PERACTS = {"dense": TINY_PERACT | {"translation_head": "dense"}, "factorised": TINY_PERACT | FACTORISED}

TINY_RVT = TINY | {"voxel_size": 15, "patch": 5, "attention_dim": 32, "heatmap_sigma_px": 0.5}
"""Sizes of the smallest RVT with every part in it."""

TWO_STAGES = {"language_filters": True, "heatmap_fusion": "product", "fine_stage_zoom": 2}
TINY_RVTS = {"one_stage": TINY_RVT, "two_stages": TINY_RVT | TWO_STAGES}


def with_option(variant: str, option: str, variants: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The variants, of which one has an option set that only this policy has."""
    return variants | {variant: variants[variant] | {option: True}}


class Specimen(NamedTuple):
    """What the tests that walk all policies know of one."""

    parameters: int  # at default settings, without the language encoder
    tiny: dict[str, dict[str, Any]]  # by the name of a variant: options of a config as small as can be


SPECIMENS = {
    "peract2": Specimen(66_180_794, with_option("factorised", "joint_decoding", TINY_PERACTS)),
    "peract_independent": Specimen(2 * 33_240_669, TINY_PERACTS),
    "peract_lf": Specimen(
        33_240_669 + 33_241_181, with_option("factorised", "follower_sees_goal", TINY_PERACTS)
    ),
    "rvt_lf": Specimen(72_696_698, with_option("two_stages", "follower_sees_goal", TINY_RVTS)),
}
"""By policy type. The parameter counts are those of the reference implementations (PerAct2 code)."""


def variants(types: list[str]) -> list[Any]:
    """Test parameters: policy type and options."""
    return [
        pytest.param((name, options), id=f"{name}-{variant}")
        for name in types
        for variant, options in SPECIMENS[name].tiny.items()
    ]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test once for every policy, or for every variant of each, by the fixture that it asks for."""
    types = list(SPECIMENS)
    leader_followers = [name for name in types if hasattr(PreTrainedConfig.get_choice_class(name), "leader")]
    for fixture, values in (
        ("policy_type", types),
        ("make_policy", variants(types)),
        ("make_leader_follower", variants(leader_followers)),
    ):
        if fixture in metafunc.fixturenames:
            metafunc.parametrize(fixture, values, indirect=fixture != "policy_type")


@pytest.fixture
def make_policy(request: pytest.FixtureRequest) -> Callable[..., KeyposePolicy]:
    """Makes every tiny variant of every policy in turn, with options changed."""
    name, options = request.param

    def make(dataset_stats: dict[str, Any] | None = None, **changes: Any) -> KeyposePolicy:
        config = PreTrainedConfig.get_choice_class(name)(**options | changes)
        return cast(KeyposePolicy, get_policy_class(name)(config, dataset_stats=dataset_stats))

    return make


make_leader_follower = make_policy
"""The same for the policies with a leader."""


@pytest.fixture
def specimens() -> dict[str, Specimen]:
    return SPECIMENS


@pytest.fixture(scope="session")
def tiny() -> dict[str, Any]:
    return dict(TINY_PERACT)


@pytest.fixture(scope="session")
def random_keyposes() -> Callable[[int], torch.Tensor]:
    """Flat keyposes (b, 18), well inside the workspace."""

    def make(samples: int) -> torch.Tensor:
        arms = torch.rand(samples, 2, 9)
        arms[..., :3] = torch.tensor([0.0, -0.2, 0.8]) + 0.4 * arms[..., :3]
        arms[..., 3:7] = torch.nn.functional.normalize(torch.randn(samples, 2, 4), dim=-1)
        arms[..., 3:7] *= torch.where(arms[..., 3:4] < 0, -1.0, 1.0)
        arms[..., 7:] = (arms[..., 7:] > 0.5).float()
        return arms.flatten(1)

    return make


@pytest.fixture(scope="session")
def make_batch(random_keyposes: Callable[[int], torch.Tensor]) -> Callable[..., dict[str, Any]]:
    """Random training batches with the keys of the schema: all cameras look down on noise."""

    def make(samples: int = 2, size: int = 16) -> dict[str, Any]:
        batch: dict[str, Any] = {}
        for camera in CAMERA_NAMES:
            batch[schema.image_key(camera)] = torch.rand(samples, 3, size, size)
            batch[schema.depth_key(camera)] = 500 + 900 * torch.rand(samples, 1, size, size)
        batch[schema.CAMERA_EXTRINSICS] = LOOKING_DOWN.repeat(samples, len(CAMERA_NAMES), 1, 1).flatten(1)
        intrinsics = torch.tensor(intrinsics_from_fovy(np.pi / 3, size, size)).float()
        batch[schema.CAMERA_INTRINSICS] = intrinsics.repeat(samples, len(CAMERA_NAMES), 1, 1).flatten(1)
        batch[schema.STATE] = torch.rand(samples, 16)
        batch[schema.EE_POSE] = torch.rand(samples, 14)
        batch[schema.GRIPPER_FINGERS] = 0.04 * torch.rand(samples, 4)
        batch[schema.KEYPOSE_STEP] = torch.arange(samples).float()[:, None] % 5
        batch[schema.ACTION] = random_keyposes(samples)
        batch["task"] = [f"lift the ball {sample}" for sample in range(samples)]
        return batch

    return make


@pytest.fixture(scope="session")
def save_policy() -> Callable[[str, dict[str, Any], Path], Path]:
    """Writes a new policy and its processors to a folder as LeRobot writes them."""

    def save(name: str, options: dict[str, Any], folder: Path) -> Path:
        config = PreTrainedConfig.get_choice_class(name)(**options)
        get_policy_class(name)(config).save_pretrained(folder)
        for processor in make_pre_post_processors(config):
            processor.save_pretrained(folder)
        return folder

    return save


@pytest.fixture
def tiny_checkpoint(save_policy: Callable[..., Path], policy_type: str, tmp_path: Path) -> Path:
    """Every policy's first variant in turn, saved."""
    return save_policy(policy_type, next(iter(SPECIMENS[policy_type].tiny.values())), tmp_path / "model")
