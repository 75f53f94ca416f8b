"""The errors of a policy's chunks are those of its hands."""

from pathlib import Path

import chunk_errors
import numpy as np
import pandas as pd
import pytest
from lerobot.datasets import LeRobotDataset

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.robots.panda_pair import ArmPair

TURN_RAD = 0.1


def test_a_turned_shoulder_has_the_error_of_its_hand_and_the_other_arm_has_none(generated: Path) -> None:
    dataset = LeRobotDataset("local/frames", root=generated / "frames", video_backend="pyav")
    columns = dataset.hf_dataset.with_format("numpy")[:]
    actions = np.stack(columns["action"]).astype(np.float64)

    def with_the_left_shoulder_turned(_: LeRobotDataset, row: int) -> np.ndarray:
        chunk = actions[row : row + 5].copy()
        chunk[:, 0] += TURN_RAD
        return chunk

    errors = pd.DataFrame(chunk_errors.measure(with_the_left_shoulder_turned, dataset, 5))
    left, right = (errors[errors.arm == arm.value] for arm in ARMS)
    reached = np.flatnonzero(columns["keyframe"] & (columns["frame_index"] >= 5))
    hands = np.stack(columns["observation.ee_pose"])[reached, :2]
    reach_m = np.linalg.norm(hands - ArmPair().base_poses[0].position[:2], axis=1)
    assert left.cm.to_numpy() == pytest.approx(200 * np.sin(TURN_RAD / 2) * reach_m, rel=0.03)
    assert not right.cm.any()
    with pytest.raises(SystemExit, match="ticks is 6, but must be from 1 to 5"):
        next(chunk_errors.measure(with_the_left_shoulder_turned, dataset, 6))
    assert left.keypose.tolist() == 3 * list(range(1, 1 + len(left) // 3))
