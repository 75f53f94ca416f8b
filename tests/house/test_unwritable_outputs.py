"""A command whose output cannot be written says so on one line, before any work."""

from dataclasses import fields
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.files import UnwritableOutput, write_file

RESULTS = Path(__file__).parents[2] / "results"
CHECKPOINT = f"--checkpoint={RESULTS / 'checkpoints/peract2_on_all'}"
ROWS = f"--results={RESULTS / 'leaderboard'}"
NEEDED = {
    "expert evaluate": ["--task=lift_ball"],
    "policy inspect": [CHECKPOINT, "--root=any"],
    "policy robustness": [CHECKPOINT, "--task=handover_item_easy"],
    "results diagnose": [ROWS],
    "results report": [ROWS],
    "task render": ["--task=lift_ball"],
    "task view": ["--task=lift_ball", "--window=false"],
}
"""Further flags of a command."""
COMMANDS = [
    name
    for name, entry in cli.find_commands().items()
    if "output" in {field.name for field in fields(cli.config_type_of(entry.load()))}
]
WORK = (
    "lerobot_env_bimanual.workers.WorkerPool.__init__",
    "lerobot_env_bimanual.world.scene.Scene.__init__",
    "lerobot_policy_bimanual.inspection.loading.load_policy",
    "subprocess.Popen",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_that_cannot_be_written_is_named_before_the_work(command, tmp_path, monkeypatch, capsys):
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    for name in WORK:
        monkeypatch.setattr(name, refuse)
    monkeypatch.setattr("lerobot_bimanual.dataset.reader.find_view", lambda *_: None)
    for module in ("policy_benchmark", "demo"):
        monkeypatch.setattr(f"lerobot_bimanual.commands.{module}.check_task", lambda _: None)
    (tmp_path / "file").touch()
    assert (
        cli.main([*command.split(), *NEEDED.get(command, []), f"--output={tmp_path / 'file/page.png'}"]) == 1
    )
    message = capsys.readouterr().err.strip()
    assert message.startswith("lerobot-bimanual: cannot write ")
    assert "\n" not in message
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "new" / "file"
    write_file(path, "first")
    write_file(path, "second")
    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(UnwritableOutput, match="No space left"):
        write_file(path, "third")
    assert path.read_text() == "second"
    assert list(path.parent.iterdir()) == [path]
