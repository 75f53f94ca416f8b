"""The command line: finding commands, running them, and what users see when something is wrong."""

import inspect
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flag_help import field_comments
from lerobot_bimanual.cli.flags import flags_of
from lerobot_bimanual.errors import BimanualError

VERB = '''
"""A module that only this test knows."""
from dataclasses import dataclass
from lerobot_bimanual.errors import BimanualError

@dataclass
class GreetConfig:
    name: str = "you"  # who is greeted
    fail: str = ""  # how to fail

def greet(config: GreetConfig) -> int | None:
    """Say hello.

    At some length.

    Examples:
        lerobot-bimanual greet --name=all
    """
    if config.fail == "clearly":
        raise BimanualError("there is nobody to greet")
    if config.fail == "by interrupt":
        raise KeyboardInterrupt
    if config.fail == "by interrupt on the way":
        raise KeyboardInterrupt("the same command goes on")
    if config.fail == "by termination":
        import os, signal
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            print("swept up")
    if config.fail == "with a code":
        return 5
    print("hello", config.name)
'''


@pytest.fixture(autouse=True)
def greeting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a distribution that adds the command `greet`."""
    package = tmp_path / "greeting_commands"
    package.mkdir()
    # The package itself cannot be imported: a summary must be had without it.
    (package / "__init__.py").write_text("import sys\nassert 'reading summaries' not in sys.argv")
    (package / "greet.py").write_text(VERB)
    metadata = tmp_path / "greeting-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: greeting\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[lerobot_bimanual.commands]\ngreet = greeting_commands.greet:greet\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for module in ("greeting_commands", "greeting_commands.greet"):
        monkeypatch.delitem(sys.modules, module, raising=False)


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_help_lists_the_commands_with_their_summaries_without_importing_them(
    words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["lerobot-bimanual", "reading summaries"])
    assert cli.main(words) == 0
    assert re.search(r"\n  greet +Say hello\.\n", capsys.readouterr().out)
    assert "greeting_commands" not in sys.modules


@pytest.mark.parametrize("words", [["dataset"], ["dataset", "--help"], ["help", "dataset"]])
def test_a_group_lists_its_commands(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words) == 0
    out = capsys.readouterr().out
    assert re.findall(r"^  (\w+)  ", out, re.M) == ["generate", "push", "regenerate", "replay", "verify"]


def test_the_help_of_a_command_has_two_forms(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["help", "dataset", "verify"]) == 0
    first = capsys.readouterr().out
    assert cli.main(["dataset", "verify", "--help"]) == 0
    assert first == capsys.readouterr().out


def test_help_of_a_command_shows_its_text_flags_and_examples(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["greet", "--help"]) == 0
    out = capsys.readouterr().out
    assert "Say hello.\n\nAt some length." in out
    assert "--name=text               who is greeted (default: you)" in out
    assert out.endswith("examples:\n  lerobot-bimanual greet --name=all\n")


def test_a_command_runs_with_its_flags(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["greet", "--name=Ada"]) == 0
    assert capsys.readouterr().out == "hello Ada\n"


def test_the_return_value_of_a_command_is_the_exit_code() -> None:
    assert cli.main(["greet", "--fail=with a code"]) == 5


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["greed"], 2, "unknown command 'greed'. Did you mean 'greet'? Commands: dataset, "),
        (["generate"], 2, "unknown command 'generate'. Did you mean 'dataset generate'? Commands: dataset, "),
        (
            ["dataset", "verfy"],
            2,
            "unknown command 'dataset verfy'. Did you mean 'dataset verify'? Commands of",
        ),
        (["greet", "--nam=x"], 2, "unknown flag --nam. Did you mean '--name'? Valid flags: --name, --fail."),
        (["greet", "--fail=clearly"], 1, "there is nobody to greet"),
        (["greet", "--fail=by interrupt"], 130, "interrupted"),
        (["greet", "--fail=by interrupt on the way"], 130, "interrupted; the same command goes on"),
    ],
)
def test_what_goes_wrong_is_said_on_one_line(
    words: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(words) == code
    captured = capsys.readouterr()
    assert captured.err.strip().startswith(f"lerobot-bimanual: {message}")
    assert captured.err.strip().count("\n") == 0
    assert captured.out == ""


def test_a_termination_ends_a_command_in_order_and_without_a_word(capsys: pytest.CaptureFixture[str]) -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as exit_:
        cli.main(["greet", "--fail=by termination"])
    assert exit_.value.code == 143
    assert capsys.readouterr() == ("swept up\n", "")
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m lerobot_bimanual.cli --help | true"
    child = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert child.stderr == ""


def test_the_traceback_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LEROBOT_BIMANUAL_TRACEBACK", "1")
    with pytest.raises(BimanualError, match="nobody"):
        cli.main(["greet", "--fail=clearly"])


def test_a_function_without_a_config_is_refused_as_a_command() -> None:
    def no_command(number: int) -> None: ...

    with pytest.raises(TypeError, match="no_command"):
        cli.config_type_of(no_command)


def test_the_installed_commands_show_their_help_without_loading_lerobot_or_torch() -> None:
    program = """
import json, sys
from lerobot_bimanual import cli
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.cli.commands import summary
summaries = {name: summary(entry) for name, entry in cli.find_commands().items()}
assert not {"torch", "lerobot", "mujoco", "draccus"} & set(sys.modules)
loads = {}
for name in summaries:
    assert cli.main([*name.split(), "--help"]) == 0
    loads[name] = sorted({"torch", "lerobot"} & set(sys.modules))
print(json.dumps([summaries, loads]))
"""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    summaries, loads = json.loads(child.stdout.splitlines()[-1])
    assert set(summaries) >= {
        "expert evaluate",
        "demo",
        "doctor",
        "dataset generate",
        "dataset replay",
        "task list",
    }
    assert all(summaries.values()), summaries
    assert not any(loads.values()), loads


def test_help_shows_long_examples_as_they_can_be_typed() -> None:
    """A backslash at the end of a line of a docstring takes the line's end with it, unless the docstring is raw."""
    swallowed = {
        (name, line)
        for name, command in cli.find_commands().items()
        for line in (inspect.getdoc(command.load()) or "").splitlines()
        if re.search(r"\S {2,}\S", line)
    }
    assert not swallowed


def test_every_flag_of_every_installed_command_is_explained() -> None:
    unexplained = {
        (name, flag.name)
        for name, command in cli.find_commands().items()
        for flag in flags_of(cli.config_type_of(command.load()))
        if not field_comments(flag.owner).get(flag.name.rpartition(".")[2])
    }
    assert not unexplained
