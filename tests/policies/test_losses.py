"""What is minimised and what is reported."""

import math

import pytest
import torch

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.codec_torch import KeyposeBins, TorchKeyposeCodec
from lerobot_policy_bimanual.keypose.losses import keypose_errors, keypose_losses
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.peract import reference
from lerobot_policy_bimanual.peract.dense_head import DenseTranslation


def random_target(samples: int = 3, voxels: int = 10) -> KeyposeBins:
    return KeyposeBins(
        torch.randint(0, voxels, (samples, 2, 3)),
        torch.randint(0, 72, (samples, 2, 3)),
        torch.randint(0, 2, (samples, 2)),
        torch.randint(0, 2, (samples, 2)),
    )


def random_prediction(samples: int = 3, voxels: int = 10) -> KeyposePrediction:
    return KeyposePrediction(
        DenseTranslation(torch.randn(samples, 2, voxels, voxels, voxels)),
        torch.randn(samples, 2, 3, 72),
        torch.randn(samples, 2, 2),
        torch.randn(samples, 2, 2),
    )


def test_losses_equal_cross_entropy_from_one_hot_labels():
    prediction, target = random_prediction(), random_target()
    pose = torch.cat(
        [prediction.rotation.flatten(2), prediction.gripper_open, prediction.ignore_collisions], dim=-1
    )
    flags = torch.stack([target.gripper_open, target.ignore_collisions], dim=-1)
    expected = reference.one_hot_loss(
        prediction.translation.logits, pose, target.voxel, torch.cat([target.rotation, flags], dim=-1)
    )
    torch.testing.assert_close(sum(keypose_losses(prediction, target).values()), expected)


def test_knowing_nothing_costs_the_logarithm_of_the_choices():
    blank = KeyposePrediction(
        DenseTranslation(torch.zeros(2, 2, 10, 10, 10)),
        torch.zeros(2, 2, 3, 72),
        torch.zeros(2, 2, 2),
        torch.zeros(2, 2, 2),
    )
    losses = {name: value.item() for name, value in keypose_losses(blank, random_target(2)).items()}
    assert losses == pytest.approx(
        {
            "translation": 2 * math.log(1000),
            "rotation": 6 * math.log(72),
            "gripper_open": 2 * math.log(2),
            "ignore_collisions": 2 * math.log(2),
        },
        rel=1e-5,
    )


def test_errors_are_the_distances_that_were_put_in(random_keyposes):
    keyposes = random_keyposes(4)
    per_arm = keyposes.view(4, 2, 9).clone()
    per_arm[:, 0, 0] += 0.03
    per_arm[:2, 1, 2] -= 0.08
    half = math.radians(10) / 2
    per_arm[:, 0, 3:7] = torch.tensor([math.cos(half), 0.0, 0.0, math.sin(half)])
    truth = keyposes.view(4, 2, 9).clone()
    truth[:, 0, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    errors = {
        name: value.item() for name, value in keypose_errors(per_arm.flatten(1), truth.flatten(1)).items()
    }
    assert errors == pytest.approx(
        {
            "left_position_cm": 3.0,
            "left_rotation_deg": 10.0,
            "left_far": 0.0,
            "right_position_cm": 4.0,
            "right_rotation_deg": 0.0,
            "right_far": 0.5,
        },
        abs=1e-2,
    )


def test_a_perfect_prediction_decodes_to_within_half_a_voxel_and_half_a_bin(random_keyposes):
    codec, keyposes = TorchKeyposeCodec(KeyposeCodec(voxels=10)), random_keyposes(5)
    errors = keypose_errors(codec.decode(codec.encode(keyposes)), keyposes)
    assert errors["left_position_cm"] <= 100 * 0.05 * 3**0.5
    assert errors["right_rotation_deg"] <= 2.5 * 3**0.5 + 1e-3
