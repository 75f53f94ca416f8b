"""The config is checked, follows the dataset, and gives LeRobot its presets."""

import re
from dataclasses import fields

import numpy as np
import pytest
import torch
from draccus.wrappers.docstring import get_attribute_docstring, get_preferred_help_text
from lerobot.configs import PreTrainedConfig
from lerobot.utils.feature_utils import dataset_to_policy_features

from lerobot_bimanual.dataset.feature_table import features
from lerobot_bimanual.dataset.schema import EE_POSE, KEYPOSE_STEP, depth_key, image_key
from lerobot_bimanual.errors import DatasetError, InvalidChoice
from lerobot_policy_bimanual import PerAct2Config, RVTLFConfig
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.dataset_fit import fit_config


@pytest.mark.parametrize(
    ("kind", "changes", "error", "hint"),
    [
        (PerAct2Config, {"translation_head": "sparse"}, InvalidChoice, "dense, factorised"),
        (PerAct2Config, {"voxel_cells": 1}, BadConfig, "at least 2"),
        (PerAct2Config, {"projection_dilations": (0,)}, BadConfig, "whole numbers from 1"),
        (PerAct2Config, {"language_filters": True}, BadConfig, "translation_head=factorised"),
        (PerAct2Config, {"decode": "mean"}, InvalidChoice, "voxel, expectation"),
        (PerAct2Config, {"language_encoder": "bert"}, InvalidChoice, "learned, wordllama, clip:"),
        (PerAct2Config, {"cameras": ("overhead",)}, InvalidChoice, "left_shoulder"),
        (PerAct2Config, {"cameras": tuple("[front]")}, BadConfig, r"'\[front\]'.*policy.cameras='\[\"front"),
        (PerAct2Config, {"cameras": ()}, BadConfig, "at least one camera"),
        (PerAct2Config, {"cameras": ("front", "front")}, BadConfig, "none twice"),
        (PerAct2Config, {"heads": 0}, BadConfig, "heads is 0, but must be a whole number from 1 to 128"),
        (PerAct2Config, {"heads": True}, BadConfig, "whole number"),
        (PerAct2Config, {"optimizer_lr": float("nan")}, BadConfig, "a number from 1e-12 to 10"),
        (PerAct2Config, {"augmentation_yaw_deg": 4.0}, BadConfig, "nothing would be turned"),
        (PerAct2Config, {"attention_dropout": 1.0}, BadConfig, "a number from 0 to 0.9"),
        (PerAct2Config, {"workspace_upper": (0.7, -0.5, 1.6)}, BadConfig, "on every axis"),
        (PerAct2Config, {"n_obs_steps": 2}, BadConfig, "must be 1"),
        (PerAct2Config, {"use_amp": True}, BadConfig, "dtype=bfloat16"),
        (PerAct2Config, {"voxel_size": 64}, BadConfig, "multiple of 5"),
        (PerAct2Config, {"num_latents": 33}, BadConfig, "evenly"),
        (PerAct2Config, {"rotation_bin_deg": 7.0}, BadConfig, "divide 360"),
        (RVTLFConfig, {"leader": "middle"}, InvalidChoice, "right, left"),
        (RVTLFConfig, {"voxel_size": 100}, BadConfig, "multiple of 11"),
        (RVTLFConfig, {"patch": 10}, BadConfig, "must be odd"),
        (RVTLFConfig, {"token_dim": 8}, BadConfig, "from 16"),
        (RVTLFConfig, {"token_dim": 20}, BadConfig, "multiple of 8"),
        (RVTLFConfig, {"attention_dim": 100}, BadConfig, "multiple of 8"),
        (RVTLFConfig, {"depth": 3}, BadConfig, "multiple of 2"),
        (RVTLFConfig, {"heatmap_sigma_px": 0.0}, BadConfig, "a number from 0.01"),
        (RVTLFConfig, {"heatmap_fusion": "sum"}, InvalidChoice, "mean, product"),
        (RVTLFConfig, {"fine_stage_zoom": 4}, BadConfig, "heatmap_fusion=product"),
        (RVTLFConfig, {"heatmap_dilations": (0,)}, BadConfig, "whole numbers from 1"),
    ],
)
def test_invalid_values_are_refused_with_valid_ones(kind, changes, error, hint):
    with pytest.raises(error, match=hint):
        kind(device="cpu", **changes)


def test_only_what_the_policy_reads_stays_among_its_inputs_and_missing_depth_is_named():
    config = PerAct2Config(device="cpu", cameras=("front",))
    config.input_features = dataset_to_policy_features(features(("front", "left_wrist"), 16, 16, "keyframes"))
    config.validate_features()
    assert EE_POSE not in config.input_features
    assert set(config.image_features) == {image_key("front"), depth_key("front")}
    del config.input_features[depth_key("front")]
    with pytest.raises(DatasetError, match=r"observation\.images\.front_depth"):
        config.validate_features()


@pytest.mark.parametrize(("largest", "horizon"), [(7.0, 8), (0.0, 2), (None, 25)])
def test_the_keypose_horizon_comes_from_the_dataset_or_else_from_the_papers_code(largest, horizon):
    config = PerAct2Config(device="cpu")
    fit_config(config, None, None if largest is None else {KEYPOSE_STEP: {"max": np.array([largest])}})
    assert config.keypose_horizon == horizon


@pytest.mark.parametrize("stats", [{}, {KEYPOSE_STEP: {"max": np.array([np.nan])}}])
def test_a_dataset_without_a_horizon_is_refused_with_the_flag_that_sets_it(stats):
    with pytest.raises(BadConfig, match=r"--policy\.keypose_horizon"):
        fit_config(PerAct2Config(device="cpu"), None, stats)


@pytest.mark.parametrize("steps", [200, 5000])
def test_learning_rate_warms_up_and_ends_low_whatever_the_number_of_steps(steps):
    config = PerAct2Config(device="cpu", optimizer_lr=1e-3)
    weight = torch.nn.Parameter(torch.zeros(1))
    optimizer = config.get_optimizer_preset().build([weight])
    scheduler = config.get_scheduler_preset().build(optimizer, steps)
    rates = []
    for _ in range(steps):
        optimizer.step()
        rates.append(scheduler.get_last_lr()[0])
        scheduler.step()
    assert rates[0] < 0.11e-3
    assert rates.index(max(rates)) == pytest.approx(0.05 * steps, abs=2)
    assert max(rates) == pytest.approx(1e-3, rel=0.01)
    assert rates[-1] == pytest.approx(0.02e-3, rel=0.02)


def test_every_flag_of_a_policy_has_a_help_text(policy_type):
    config_class = PreTrainedConfig.get_choice_class(policy_type)
    lerobots = {field.name for field in fields(PreTrainedConfig)}
    for field in fields(config_class):
        if field.name not in lerobots:
            text = get_preferred_help_text(get_attribute_docstring(config_class, field.name))
            assert text, field.name
            assert not re.search(r"""^#|field\(|def |class |"{3}""", text), (field.name, text)
