"""The errors measured for the first two keyposes of an episode are the distances by which they were moved."""

import kept_errors
import numpy as np
import pytest
from planted_failures import SEED, evaluation, expert_keyposes, played

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM
from lerobot_env_bimanual.verification.result_files import ResultFile

TASK = "lift_ball"
SHIFTS_M = {SEED: 0.01, SEED + 1: 0.02, SEED + 2: 0.2}


def test_errors_equal_the_shifts_of_the_hands_and_too_large_shifts_are_left_out(tmp_path):
    episodes = []
    for seed, shift_m in SHIFTS_M.items():
        keyposes = expert_keyposes(TASK, seed=seed).copy()
        hands = keyposes.reshape(len(keyposes), len(ARMS), ARM_KEYPOSE_DIM)
        # Both hands are too high at both keyposes, the right one by half at the second; in the last episode by too much.
        hands[:2, :, 2] += shift_m
        hands[1, Arm.RIGHT.ordinal, 2] -= shift_m / 2
        episodes.append(played(TASK, keyposes, seed))
    evaluation(TASK, {"control_mode": "keypose"}, *episodes).write(tmp_path / "record.json")
    result = ResultFile.read(tmp_path / "record.json")
    shifts_cm = [100 * shift_m for shift_m in SHIFTS_M.values()][:2]
    expected = [[[0, 0, cm], [0, 0, share * cm]] for cm in shifts_cm for share in (1, 0.5)]
    np.testing.assert_allclose(np.array([*kept_errors.errors_cm(result)]), expected, atol=1e-3)
    row = kept_errors.row(result)  # the means and the correlation of all hands
    assert [row[name] for name in ("hands", "first_cm", "second_cm")] == pytest.approx([4, 1.5, 1.125])
    assert row["z"] == pytest.approx(np.corrcoef([1, 1, 2, 2], [1, 0.5, 2, 1])[0, 1], abs=1e-4)
