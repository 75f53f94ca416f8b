"""What is minimised and what is reported."""

import math

import pytest
import torch

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.keypose.losses import keypose_errors, keypose_losses
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.peract.dense_head import DenseTranslation


def random_target(samples: int = 3, voxels: int = 10) -> KeyposeBins:
    return KeyposeBins(
        torch.randint(0, voxels, (samples, 2, 3)),
        torch.randint(0, 72, (samples, 2, 3)),
        torch.randint(0, 2, (samples, 2)),
        torch.randint(0, 2, (samples, 2)),
    )


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
