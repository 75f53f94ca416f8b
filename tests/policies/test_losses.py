"""What is minimised and what is reported."""

import math

import pytest
import torch

from lerobot_policy_bimanual.keypose.losses import keypose_errors


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
