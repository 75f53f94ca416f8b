"""A chain of commands: what runs again, what is resumed, what is said when one fails."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from lerobot_bimanual.benchmark.pipeline import Command, Pipeline, call
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import locked

NEW_TRAINING = ["lerobot-train", "--steps=4"]
RESUMED = ["--trust_checkpoint=true", "--resume=true"]


@pytest.fixture
def pipeline(tmp_path: Path) -> Pipeline:
    return Pipeline(tmp_path / "chain", Console(quiet=True))


def counting(folder: Path, more: str = "", output: Path | None = None, **options) -> Command:
    """A command that appends a letter to `folder/count`, then does something more."""
    program = f"open({str(folder / 'count')!r}, 'a').write('x'); {more}"
    return Command("count", ["python", "-c", program], output or folder / "count", **options)


def count(folder: Path) -> int:
    return len((folder / "count").read_text())


def test_a_command_runs_once(tmp_path):
    command, console = counting(tmp_path, output=tmp_path / "count"), Console(record=True, width=200)
    for _ in range(2):
        (pipeline := Pipeline(tmp_path / "chain", console)).run(command)
    assert pipeline.seconds(command) > 0
    assert count(tmp_path) == 1
    shown = console.export_text()
    assert f"$ {command}" in shown
    assert "count (already done)" in shown


def test_a_command_runs_again_when_its_words_output_or_input_changed(tmp_path, pipeline):
    weights, output = tmp_path / "weights", tmp_path / "output"
    weights.write_text("some")
    command = counting(tmp_path, f"open({str(output)!r}, 'w')", inputs=(weights,), output=output)
    pipeline.run(command)
    output.unlink()
    pipeline.run(command)
    weights.write_text("others")
    pipeline.run(command)
    pipeline.run(counting(tmp_path, f"open({str(output)!r}, 'w').close()", inputs=(weights,), output=output))
    assert count(tmp_path) == 4


def test_a_second_process_in_the_same_folder_is_refused_unless_its_command_is_done(tmp_path, pipeline):
    with locked(tmp_path / "chain"), pytest.raises(BimanualError, match="by another process; wait for it"):
        pipeline.run(counting(tmp_path))
    pipeline.run(counting(tmp_path))
    with locked(tmp_path / "chain"):
        pipeline.run(counting(tmp_path))
    assert count(tmp_path) == 1


def test_an_input_that_is_gone_and_a_damaged_marker_are_named(tmp_path, pipeline):
    (tmp_path / "weights").touch()
    command = counting(tmp_path, inputs=(tmp_path / "weights",))
    pipeline.run(command)
    (tmp_path / "chain" / "count.command.json").write_text("{")
    with pytest.raises(BimanualError, match=r"count\.command\.json: .*Invalid JSON"):
        pipeline.run(command)
    (tmp_path / "weights").unlink()
    with pytest.raises(BimanualError, match=r"weights is missing, but was made .*put it back, or choose"):
        pipeline.run(command)


def test_a_command_that_fails_or_leaves_no_output_is_named_and_tried_again(tmp_path, pipeline):
    for more, message in (("raise SystemExit(3)", "failed with exit code 3"), ("", "did not write .*output")):
        command = counting(tmp_path, more, output=tmp_path / "output")
        for _ in range(2):
            with pytest.raises(BimanualError, match=message) as caught:
                pipeline.run(command)
            assert str(caught.value).endswith(str(command))
    assert count(tmp_path) == 4


def test_a_command_that_may_exit_with_1_succeeds_only_if_it_wrote_its_output(tmp_path, pipeline):
    output = tmp_path / "verdict"
    writing = f"open({str(output)!r}, 'w')"
    output.touch()  # an old verdict does not hide a failure
    for more in ("raise SystemExit(1)", f"{writing}; raise SystemExit(3)"):
        with pytest.raises(BimanualError, match="exit code"):
            pipeline.run(counting(tmp_path, more, output=output, allows_exit_code_1=True))
    judging = counting(tmp_path, f"{writing}; raise SystemExit(1)", output=output, allows_exit_code_1=True)
    pipeline.run(judging)
    pipeline.run(judging)
    assert count(tmp_path) == 3


@pytest.mark.parametrize(("setting", "seen"), [(None, "1"), ("0", "0")])
def test_commands_are_offline_unless_the_user_says_otherwise(setting, seen, tmp_path, pipeline, monkeypatch):
    monkeypatch.delenv("HF_HUB_OFFLINE")
    if setting is not None:
        monkeypatch.setenv("HF_HUB_OFFLINE", setting)
    program = f"import os; open({str(tmp_path / 'seen')!r}, 'w').write(os.environ['HF_HUB_OFFLINE'])"
    pipeline.run(Command("offline", ["python", "-c", program], tmp_path / "seen"))
    assert (tmp_path / "seen").read_text() == seen


class FakeTraining:
    """Stands in for `lerobot-train`: records its words, leaves a checkpoint and returns an exit code."""

    def __init__(self, folder: Path):
        self.calls: list[list[str]] = []
        self.code = 0
        self.saves = True
        self.last = folder / "checkpoints" / "last" / "pretrained_model" / "train_config.json"

    def __call__(self, words: list[str]) -> int:
        self.calls.append(words)
        self.last.parents[2].mkdir(parents=True, exist_ok=True)
        if self.saves:
            self.last.parent.mkdir(parents=True, exist_ok=True)
            self.last.touch()
        return self.code


@pytest.fixture
def training(tmp_path: Path) -> FakeTraining:
    return FakeTraining(tmp_path / "train")


@pytest.fixture
def trainings(tmp_path: Path, training: FakeTraining) -> Pipeline:
    """A chain whose programs are that training."""
    return Pipeline(tmp_path / "chain", Console(quiet=True), training)


def training_command(tmp_path: Path, *more: str) -> Command:
    folder = tmp_path / "train"
    return Command("train", [*NEW_TRAINING, *more], folder, training_folder=folder)


def test_an_interrupted_training_goes_on_from_its_last_checkpoint(tmp_path, trainings, training):
    kept = "--keep_last=2"
    first_command, command = (training_command(tmp_path, *each) for each in ((), (kept,)))
    training.code = 1
    with pytest.raises(BimanualError):
        trainings.run(first_command)
    first = trainings.seconds(command)
    training.code = 0
    trainings.run(command)
    resumed = ["lerobot-train", f"--config_path={training.last}", *RESUMED, kept]
    assert training.calls == [NEW_TRAINING, resumed]
    assert trainings.seconds(command) > first  # both runs are counted
    trainings.run(command)
    assert len(training.calls) == 2


def test_a_training_without_a_checkpoint_starts_anew_in_an_empty_place(tmp_path, trainings, training):
    training.code, training.saves = 1, False
    for _ in range(2):
        with pytest.raises(BimanualError):
            trainings.run(training_command(tmp_path))
        (tmp_path / "train" / "rest").touch()
    assert training.calls == [NEW_TRAINING, NEW_TRAINING]
    training.code = 0
    trainings.run(training_command(tmp_path))
    assert not (tmp_path / "train" / "rest").exists()


@pytest.mark.parametrize(("dangles", "is_whole"), [(False, True), (True, True), (False, False)])
def test_without_a_link_to_the_last_checkpoint_the_newest_one_is_resumed_unless_it_was_cut_off(
    dangles, is_whole, tmp_path, trainings, training
):
    training.code = 1
    with pytest.raises(BimanualError):
        trainings.run(training_command(tmp_path))
    newest = training.last.parents[1].rename(training.last.parents[1].with_name("000002"))
    if dangles:
        newest.with_name("last").symlink_to("000004")
    if is_whole:
        (newest / "training_state").mkdir()
        (newest / "training_state" / "optimizer_param_groups.json").touch()
    training.code, training.saves = 0, False
    trainings.run(training_command(tmp_path))
    resumed = ["lerobot-train", f"--config_path={newest}/pretrained_model/train_config.json", *RESUMED]
    assert training.calls[1:] == [resumed if is_whole else NEW_TRAINING]


@pytest.mark.parametrize("by_chain", [True, False])
def test_checkpoints_of_another_training_are_kept(by_chain, tmp_path, trainings, training):
    if by_chain:
        trainings.run(training_command(tmp_path))
    else:
        training(NEW_TRAINING)
    with pytest.raises(
        BimanualError, match=r"other flags or demonstrations, .*Choose another --output, or remove"
    ):
        trainings.run(training_command(tmp_path, "--seed=1"))
    assert training.last.exists()
    assert len(training.calls) == 1


def test_a_training_is_not_resumed_on_other_demonstrations(tmp_path, trainings, training):
    (demonstrations := tmp_path / "bimanual.json").write_text("some")
    command = replace(training_command(tmp_path), inputs=(demonstrations,))
    trainings.run(command)
    demonstrations.write_text("others")
    with pytest.raises(BimanualError, match="other flags or demonstrations"):
        trainings.run(command)
    assert len(training.calls) == 1


@pytest.mark.parametrize("by_chain", [True, False])
def test_weights_of_a_training_that_was_finished_elsewhere_are_kept_if_they_cannot_be_resumed(
    by_chain, tmp_path, trainings, training
):
    if by_chain:
        trainings.run(training_command(tmp_path))
    else:
        training(NEW_TRAINING)
    copied = training.last.parents[1].rename(training.last.parents[1].with_name("000004"))
    with pytest.raises(BimanualError, match="was made at another place"):
        trainings.run(training_command(tmp_path, "--output_dir=elsewhere"))
    assert copied.exists()


INTERRUPTED = """
import sys
from pathlib import Path
from rich.console import Console
from lerobot_bimanual.cli import command_line
from lerobot_bimanual.benchmark.pipeline import Command, Pipeline
sleep = "import os, time; print(os.getpid(), flush=True); time.sleep(1000)"
def dispatch(_):
    folder = Path(sys.argv[1])
    Pipeline(folder, Console(quiet=True)).run(Command("sleep", ["python", "-c", sleep], folder))
command_line._dispatch = dispatch
sys.exit(command_line.main())
"""


@pytest.fixture
def benchmark(tmp_path) -> tuple[subprocess.Popen[str], int]:
    """A process that runs a program, and that program's id."""
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def test_an_interrupt_from_the_keyboard_ends_the_program_and_says_how_to_go_on(tmp_path, benchmark):
    process, program = benchmark
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, errors = process.communicate(timeout=300)
    assert errors == "\nlerobot-bimanual: interrupted; the same command continues where it stopped\n"
    assert process.returncode == 130
    with pytest.raises(ProcessLookupError):
        os.kill(program, 0)
    assert not json.loads((tmp_path / "sleep.command.json").read_text())["done"]


def test_a_killed_benchmark_takes_its_program_with_it(benchmark):
    process, _ = benchmark
    process.kill()
    process.communicate(timeout=300)  # the program has the other end of the pipes


def test_programs_beside_python_come_first_and_those_of_the_path_after(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / "user"))
    for folder, code in ((tmp_path / "user", 3), (tmp_path, 4)):
        folder.mkdir(exist_ok=True)
        (folder / "program").write_text(f"#!/bin/sh\nexit {code}\n")
        (folder / "program").chmod(0o755)
        assert call(["program"]) == code
