"""The config is checked, survives the checkpoint, and gives LeRobot its presets."""

import re
from dataclasses import fields

import pytest
import torch
from draccus.wrappers.docstring import get_attribute_docstring, get_preferred_help_text
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig

from lerobot_bimanual.dataset.schema import EE_POSE, VECTORS, depth_key, image_key
from lerobot_bimanual.errors import DatasetError, InvalidChoice
from lerobot_policy_bimanual import PerAct2Config, PerActIndependentConfig, PerActLFConfig
from lerobot_policy_bimanual.errors import BadConfig


def dataset_inputs(cameras: tuple[str, ...]) -> dict[str, PolicyFeature]:
    inputs = {}
    for camera in cameras:
        inputs[image_key(camera)] = PolicyFeature(FeatureType.VISUAL, (3, 16, 16))
        inputs[depth_key(camera)] = PolicyFeature(FeatureType.VISUAL, (1, 16, 16))
    for key, names in VECTORS.items():
        inputs[key] = PolicyFeature(FeatureType.STATE, (len(names),))
    return inputs


def test_config_survives_saving(tmp_path):
    config = PerAct2Config(device="cpu", cameras=("front",), decode="expectation", voxel_size=50)
    config.input_features = dataset_inputs(("front",))
    config.save_pretrained(tmp_path)
    assert PreTrainedConfig.from_pretrained(tmp_path) == config


@pytest.mark.parametrize(
    ("changes", "error", "hint"),
    [
        ({"translation_head": "sparse"}, InvalidChoice, "dense, factorised"),
        ({"voxel_cells": 1}, BadConfig, "at least 2"),
        ({"translation_head": "factorised", "projection_dilations": (0,)}, BadConfig, "numbers from 1"),
        ({"language_filters": True}, BadConfig, "translation_head=factorised"),
        ({"decode": "mean"}, InvalidChoice, "voxel, expectation"),
        ({"language_encoder": "bert"}, InvalidChoice, "learned, wordllama, clip:"),
        ({"cameras": ("overhead",)}, InvalidChoice, "left_shoulder"),
        ({"cameras": tuple("[front]")}, BadConfig, r"'\[front\]', .*--policy.cameras='\[\"front\""),
        ({"cameras": ()}, BadConfig, "at least one camera"),
        ({"cameras": ("front", "front")}, BadConfig, "none twice"),
        ({"heads": 0}, BadConfig, "heads is 0, but must be a whole number from 1 to 128"),
        ({"heads": True}, BadConfig, "whole number"),
        ({"optimizer_lr": float("nan")}, BadConfig, "a number from 0 to 10"),
        ({"attention_dropout": 1.0}, BadConfig, "a number from 0 to 0.9"),
        ({"workspace_upper": (0.7, -0.5, 1.6)}, BadConfig, "on every axis"),
        ({"n_obs_steps": 2}, BadConfig, "must be 1"),
        ({"voxel_size": 64}, BadConfig, "multiple of 5"),
        ({"num_latents": 33}, BadConfig, "evenly"),
        ({"rotation_bin_deg": 7.0}, BadConfig, "divide 360"),
    ],
)
def test_values_that_cannot_work_are_refused_with_what_can(changes, error, hint):
    with pytest.raises(error, match=hint):
        PerAct2Config(device="cpu", **changes)


def test_only_what_the_policy_reads_stays_among_its_inputs_and_missing_depth_is_named():
    config = PerAct2Config(device="cpu", cameras=("front",))
    config.input_features = dataset_inputs(("front", "left_wrist"))
    config.validate_features()
    assert EE_POSE not in config.input_features
    assert set(config.image_features) == {image_key("front"), depth_key("front")}
    del config.input_features[depth_key("front")]
    with pytest.raises(DatasetError, match=r"observation\.images\.front_depth"):
        config.validate_features()


@pytest.mark.parametrize("policy", [PerActIndependentConfig, PerActLFConfig])
def test_latents_of_a_network_for_one_arm_may_be_odd(policy):
    assert policy(device="cpu", num_latents=33).num_latents == 33


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
