"""Both arms have to look: no arm's keyposes are the same in every scene; shifted hands move as said."""

import coordination
import pytest

from lerobot_env_bimanual.experts import baselines
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import list_tasks


@pytest.mark.weekly
@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("task", list_tasks())
def test_keyposes_of_both_arms_vary(task, setting, monkeypatch):
    monkeypatch.setattr(baselines, "DEMONSTRATIONS", 12)
    monkeypatch.setattr(coordination, "demonstrations", baselines.demonstrations.__wrapped__)
    for row in coordination.spread(task, setting):
        assert max(map(float, row["place, cm"].split(" to "))) > 2, row
