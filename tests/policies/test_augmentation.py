"""Moving the scene and its labels together changes nothing that matters."""

import torch

from lerobot_bimanual.geometry.rotations_torch import (
    quat_wxyz_conjugate,
    quat_wxyz_multiply,
    quat_wxyz_to_matrix,
    rotation_angle_rad,
)
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.keypose.augmentation import move_keyposes, sample_motions
from lerobot_policy_bimanual.keypose.observation import observe


def sample(keyposes: torch.Tensor, **changes) -> torch.Tensor:
    options = {"augmentation_shift_m": (0.125, 0.125, 0.05), "augmentation_yaw_deg": 45.0}
    return sample_motions(keyposes, PerAct2Config(device="cpu", **(options | changes)))


def arms(keyposes: torch.Tensor) -> torch.Tensor:
    return keyposes.view(-1, 2, 9)


def in_left_frame(keyposes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Pose of the right hand as the left hand sees it: position (b, 3), quaternion (b, 4)."""
    left, right = arms(keyposes).unbind(1)
    inverse = quat_wxyz_conjugate(left[:, 3:7])
    offset = quat_wxyz_to_matrix(inverse) @ (right[:, :3] - left[:, :3])[..., None]
    return offset[..., 0], quat_wxyz_multiply(inverse, right[:, 3:7])


def test_moved_keyposes_keep_their_relative_pose_flags_and_canonical_quaternions(random_keyposes):
    keyposes = random_keyposes(50).double()
    moved = move_keyposes(sample(keyposes), keyposes)
    before, after = in_left_frame(keyposes), in_left_frame(moved)
    assert not torch.allclose(keyposes, moved)
    torch.testing.assert_close(after[0], before[0])
    assert rotation_angle_rad(after[1], before[1]).max() < 1e-6
    quaternions, flags = arms(moved)[..., 3:].split((4, 2), dim=-1)
    assert torch.equal(flags, arms(keyposes)[..., 7:])
    assert (quaternions[..., 0] >= 0).all()
    torch.testing.assert_close(quaternions.norm(dim=-1), torch.ones(50, 2).double())


def test_cloud_and_labels_move_by_the_same_transform(make_batch):
    batch = make_batch(samples=3)
    motion = sample(batch["action"])
    still = observe(batch, cameras=("front",), keypose_horizon=25).points
    moved = observe(batch, cameras=("front",), keypose_horizon=25, motion=motion).points
    expected = motion[:, :3, :3] @ still + motion[:, :3, 3:]
    torch.testing.assert_close(moved, expected)


def test_yaw_turns_about_the_workspace_centre_in_whole_rotation_bins(random_keyposes):
    keyposes = random_keyposes(200)
    motion = sample(keyposes, augmentation_shift_m=(0.0, 0.0, 0.0))
    center = torch.tensor(VOXEL_WORKSPACE.center, dtype=torch.float32)
    torch.testing.assert_close(motion[:, :3, :3] @ center + motion[:, :3, 3], center.expand(200, 3))
    yaw_deg = torch.rad2deg(torch.atan2(motion[:, 1, 0], motion[:, 0, 0]))
    torch.testing.assert_close(yaw_deg, 5 * (yaw_deg / 5).round(), atol=1e-3, rtol=0)
    assert yaw_deg.abs().max() <= 45.001
    assert len((yaw_deg / 5).round().unique()) == 19


def test_shifts_fill_their_limits_and_keep_both_hands_inside(random_keyposes):
    motion = sample(random_keyposes(500), augmentation_yaw_deg=0.0)
    shift = motion[:, :3, 3].abs().amax(0)
    limits = torch.tensor([0.125, 0.125, 0.05])
    assert (shift <= limits + 1e-6).all()
    assert (shift > 0.9 * limits).all()
    keyposes = random_keyposes(100)
    arms(keyposes)[:, 0, 0] = 0.695  # the left hand almost leaves through x, the right one through y
    arms(keyposes)[:, 1, 1] = -0.495
    motion = sample(keyposes)
    moved = arms(move_keyposes(motion, keyposes))[..., :3]
    assert VOXEL_WORKSPACE.contains(moved.numpy()).all()
    assert (motion != torch.eye(4)).flatten(1).any(1).float().mean() > 0.5
    keyposes = random_keyposes(2)
    keyposes[0, 0] = 5.0
    motion = sample(keyposes)
    assert torch.equal(motion[0], torch.eye(4))
    assert not torch.equal(motion[1], torch.eye(4))


def test_processes_of_one_training_that_are_seeded_alike_draw_other_motions(random_keyposes, monkeypatch):
    keyposes = random_keyposes(4)

    def drawn(rank: int, processes: int = 2) -> torch.Tensor:
        monkeypatch.setattr(torch.distributed, "is_initialized", lambda: True)
        monkeypatch.setattr(torch.distributed, "get_world_size", lambda: processes)
        monkeypatch.setattr(torch.distributed, "get_rank", lambda: rank)
        torch.manual_seed(0)
        return torch.stack([sample(keyposes) for _ in range(2)])

    assert torch.equal(drawn(1), drawn(1))
    assert not torch.equal(drawn(0), drawn(1))
    assert not torch.equal(*drawn(1))
    alone = drawn(0, processes=1)
    monkeypatch.undo()
    torch.manual_seed(0)
    assert torch.equal(sample(keyposes), alone[0])
