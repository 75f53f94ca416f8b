"""What all keypose policies do around their networks, tried on the smallest PerAct2."""

import pytest
import torch

from lerobot_bimanual.dataset.schema import ACTION, CAMERA_INTRINSICS
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy


def test_report_holds_plain_numbers_and_adds_up_to_the_loss(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny)).train()
    loss, report = policy(make_batch())
    assert all(type(value) is float for value in report.values())
    parts = sum(value for name, value in report.items() if name.endswith("_loss"))
    assert loss.item() == pytest.approx(parts, rel=1e-5)
    assert {"left_position_cm", "right_rotation_deg", "left_far"} <= report.keys()


def test_images_of_any_size_are_accepted(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny, cameras=("front", "left_wrist")))
    small, large = make_batch(size=8), make_batch(size=24)
    mixed = {key: large[key] if "left_wrist" in key else value for key, value in small.items()}
    mixed[CAMERA_INTRINSICS] = small[CAMERA_INTRINSICS].clone()
    mixed[CAMERA_INTRINSICS][:, 27:36] = large[CAMERA_INTRINSICS][:, 27:36]  # those of the left wrist
    for batch in (small, large, mixed):
        assert policy.select_action(batch).shape == (2, 18)


def test_time_runs_from_one_to_minus_one_over_the_horizon(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny | {"keypose_horizon": 5}))
    batch = make_batch(samples=4)
    batch["observation.keypose_step"] = torch.tensor([[0.0], [2.0], [4.0], [9.0]])
    proprio = policy.observe(batch).proprio.view(4, 2, 4)
    assert proprio[:, :, 3].tolist() == [[1.0] * 2, [0.0] * 2, [-1.0] * 2, [-1.0] * 2]


def test_proprioception_is_per_arm_and_left_first(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch(samples=1)
    batch["observation.state"] = torch.zeros(1, 16)
    batch["observation.state"][0, 7] = 1.0
    batch["observation.gripper_fingers"] = torch.tensor([[0.04, 0.03, 0.01, 0.0]])
    proprio = policy.observe(batch).proprio.view(2, 4)
    torch.testing.assert_close(proprio[:, :3], torch.tensor([[1.0, 1.0, 0.75], [0.0, 0.25, 0.0]]))


def test_training_without_labels_is_refused(tiny, make_batch):
    batch = make_batch()
    del batch[ACTION]
    with pytest.raises(DatasetError, match=ACTION):
        PerAct2Policy(PerAct2Config(**tiny))(batch)


def test_outer_autocast_does_not_touch_the_geometry(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch()
    expected = policy.observe(batch).points
    seen = []
    policy.predict = lambda observation, target: (
        seen.append(observation) or PerAct2Policy.predict(policy, observation, target)
    )
    with torch.autocast("cpu", torch.bfloat16):
        policy.eval()(batch)
    assert torch.equal(seen[0].points, expected)
