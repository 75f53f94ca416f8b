"""Both arms have to look: no arm's keyposes are the same in every scene; shifted hands move as said."""

import coordination
import numpy as np
import pytest
from sample_results import outcome

from lerobot_env_bimanual.experts import baselines
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import list_tasks


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("task", list_tasks())
def test_keyposes_of_both_arms_vary(task, setting, monkeypatch):
    monkeypatch.setattr(baselines, "DEMONSTRATIONS", 12)
    monkeypatch.setattr(coordination, "demonstrations", baselines.demonstrations.__wrapped__)
    for row in coordination.spread(task, setting):
        assert max(map(float, row["place, cm"].split(" to "))) > 2, row


@pytest.mark.sim
def test_shifted_hands_move_as_said(monkeypatch):
    moved = []

    def play(env, seed, player):
        env.reset(seed=seed)
        pairs = zip(coordination.expert()(env), player(env), strict=True)
        first = next((given.action, shifted.action) for given, shifted in pairs)
        shift_m = (first[1] - first[0]).reshape(2, -1)
        assert shift_m[:, 2:] == pytest.approx(0, abs=1e-6)
        cosine = np.sign(shift_m[0, :2] @ shift_m[1, :2])
        moved.append((round(100 * float(np.linalg.norm(shift_m[0, :2]))), int(cosine)))
        return outcome(moved[-1][0] < 3)

    monkeypatch.setattr(coordination, "run_episode", play)
    row = coordination.shifted("lift_ball", "varied", 2)
    assert row == {"task": "`lift_ball`", "same way": "2, 2, 0, 0", "opposite ways": "2, 2, 0, 0"}
    assert moved == [(cm, sign) for sign in (1, -1) for cm in (1, 2, 3, 4) for _ in range(2)]
