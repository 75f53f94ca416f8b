"""Where nothing can be written, one line says so before any work is done."""

from collections.abc import Callable
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.output_file import UnwritableOutput, write_file

ROWS = Path(__file__).parents[2] / "results" / "leaderboard"
REPORTS = ROWS.parent / "expert_reports"

COMMANDS: dict[str, Callable[[Path], list[str]]] = {
    "expert evaluate": lambda place: ["expert", "evaluate", "--task=lift_ball", f"--output={place}"],
    "render": lambda place: ["task", "render", "--task=lift_ball", f"--output={place / 'folder'}"],
    "report": lambda place: ["expert", "report", f"--expert_reports={REPORTS}", f"--output={place}"],
    "compare's figure": lambda place: [
        "results",
        "compare",
        f"--first={ROWS}",
        f"--second={ROWS}",
        f"--figure={place}",
    ],
    "blame's figure": lambda place: ["results", "diagnose", f"--results={ROWS}", f"--figure={place}"],
    "ladder": lambda place: [
        "policy",
        "robustness",
        f"--checkpoint={ROWS.parent / 'checkpoints/peract2_on_all'}",
        "--task=handover_item_easy",
        f"--output={place}",
    ],
    "expert evaluate --axes": lambda place: [
        "expert",
        "evaluate",
        "--axes=all",
        "--task=lift_ball",
        f"--output={place / 'folder'}",
    ],
    "report-results": lambda place: ["results", "report", f"--results={ROWS}", f"--output={place}"],
    "benchmark": lambda place: ["policy", "benchmark", f"--output={place / 'folder'}"],
    "inspect": lambda place: [
        "policy",
        "inspect",
        f"--checkpoint={ROWS.parent / 'checkpoints/peract2_on_all'}",
        "--root=any",
        f"--output={place}",
    ],
}


@pytest.fixture(autouse=True)
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("work has begun")

    monkeypatch.setattr("lerobot_env_bimanual.workers.WorkerPool.__init__", refuse)
    monkeypatch.setattr("lerobot_env_bimanual.reports.expert_tables.ExpertReports.read", refuse)
    monkeypatch.setattr("lerobot_bimanual.reports.benchmark_page.read_results", refuse)
    monkeypatch.setattr("lerobot_bimanual.commands.results_compare.BenchmarkResult.read", refuse)
    monkeypatch.setattr("lerobot_bimanual.commands.policy_benchmark.check_task", lambda _: None)
    monkeypatch.setattr("lerobot_bimanual.benchmark.pipeline.subprocess.Popen", refuse)
    monkeypatch.setattr("lerobot_bimanual.dataset.reader.find_view", lambda *_: None)
    monkeypatch.setattr("lerobot_policy_bimanual.inspection.loading.load_policy", refuse)


PLACES = {"below a file": "file/page", "on a device": "/proc/self/page", "a folder": "folder"}


@pytest.mark.parametrize(
    ("verb", "place"),
    [
        (verb, place)
        for verb in COMMANDS
        for place in PLACES
        if place != "a folder"
        or verb not in ("render", "benchmark", "expert evaluate --axes", "inspect")  # which write into one
    ],
)
def test_an_output_that_cannot_be_written_is_named_before_the_work(verb, place, tmp_path, capsys):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    where = tmp_path / PLACES[place]
    assert cli.main(COMMANDS[verb](where)) == 1
    message = capsys.readouterr().err.strip()
    assert message.startswith("lerobot-bimanual: cannot write ")
    assert "\n" not in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file"
    write_file(path, "first")
    write_file(path, "second")
    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(UnwritableOutput, match="No space left"):
        write_file(path, "third")
    assert path.read_text() == "second"
    assert list(path.parent.iterdir()) == [path]


def full_disk(_: int) -> None:
    raise OSError(28, "No space left on device")
