"""`lerobot-bimanual-train` speaks before it imports LeRobot, and then is what it always was."""

import sys
from types import SimpleNamespace

from lerobot_policy_bimanual.training import program


def test_the_program_speaks_and_then_trains(monkeypatch, capsys):
    heard = []

    def train() -> int:
        heard.append(capsys.readouterr().err)
        return 7

    monkeypatch.setitem(sys.modules, "lerobot_policy_bimanual.training.train", SimpleNamespace(main=train))
    assert program.main() == 7
    assert heard == ["lerobot-bimanual-train: importing LeRobot\n"]
