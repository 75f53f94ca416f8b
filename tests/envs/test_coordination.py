"""Both arms have to look: no arm's keyposes are the same in every scene."""

from collections import Counter

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, POSITION
from lerobot_env_bimanual.experts import baselines
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import list_tasks


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("task", list_tasks())
def test_keyposes_of_both_arms_vary(task, setting, monkeypatch):
    monkeypatch.setattr(baselines, "DEMONSTRATIONS", 12)
    known = [keyposes for _, keyposes in baselines.demonstrations.__wrapped__(task, 0, setting)]
    usual = Counter(map(len, known)).most_common(1)[0][0]
    alike = np.stack([keyposes for keyposes in known if len(keyposes) == usual])
    positions_m = alike.reshape(len(alike), usual, len(ARMS), ARM_KEYPOSE_DIM)[..., POSITION]
    assert (np.linalg.norm(positions_m.std(axis=0), axis=-1).max(axis=0) > 0.02).all()
