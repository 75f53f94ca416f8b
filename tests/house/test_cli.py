"""The command line: groups of commands, their help, exit codes, and one line for every mistake."""

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

COMMAND = '''
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
        raise BimanualError("there is no one to greet")
    if config.fail == "by interrupt":
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
    package, metadata = tmp_path / "greeting_commands", tmp_path / "greeting-1.0.dist-info"
    package.mkdir()
    # The package itself cannot be imported: a summary must be found without it.
    (package / "__init__.py").write_text("import sys\nassert 'reading summaries' not in sys.argv")
    (package / "greet.py").write_text(COMMAND)
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: greeting\nVersion: 1.0\n")
    entry = "[lerobot_bimanual.commands]\ngreet = greeting_commands.greet:greet\n"
    (metadata / "entry_points.txt").write_text(entry)
    monkeypatch.syspath_prepend(tmp_path)
    for module in ("greeting_commands", "greeting_commands.greet"):
        monkeypatch.delitem(sys.modules, module, raising=False)


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"], ["help"]])
def test_help_lists_commands_by_section_without_importing_them(words, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["lerobot-bimanual", "reading summaries"])
    assert cli.main(words) == 0
    out = capsys.readouterr().out
    sections = ["start", "data", "train and score", "maintain", "more"]
    assert re.findall(r"^([a-z ]+):$", out, re.M) == sections
    assert re.search(r"\nmore:\n  greet +Say hello\.\n", out)
    assert "greeting_commands" not in sys.modules


@pytest.mark.parametrize("words", [["dataset"], ["dataset", "--help"], ["help", "dataset"]])
def test_a_group_lists_its_commands(words, capsys):
    assert cli.main(words) == 0
    found = re.findall(r"^  (\w+)  ", capsys.readouterr().out, re.M)
    assert found == ["generate", "push", "regenerate", "replay", "verify"]


@pytest.mark.parametrize("words", [["greet", "--help"], ["help", "greet"]])
def test_help_of_a_command_shows_its_text_flags_and_examples(words, capsys):
    assert cli.main(words) == 0
    out = capsys.readouterr().out
    assert "Say hello.\n\nAt some length." in out
    assert "--name=text               who is greeted (default: you)" in out
    assert out.endswith("examples:\n  lerobot-bimanual greet --name=all\n")


def test_a_command_runs_with_its_flags_and_its_return_value_is_the_exit_code(capsys):
    assert cli.main(["greet", "--name=Ada"]) == 0
    assert capsys.readouterr().out == "hello Ada\n"
    assert cli.main(["greet", "--fail=with a code"]) == 5


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["greed"], 2, "unknown command 'greed'. Did you mean 'greet'? Commands: dataset, "),
        (["generate"], 2, "unknown command 'generate'. Did you mean 'dataset generate'? Commands: "),
        (["dataset", "verfy"], 2, "unknown command 'dataset verfy'. Did you mean 'dataset verify'? "),
        (["greet", "--nam=x"], 2, "unknown flag --nam. Did you mean '--name'? Valid flags: --name, --fail."),
        (["greet", "--fail=clearly"], 1, "there is no one to greet"),
        (["greet", "--fail=by interrupt"], 130, "interrupted; the same command goes on"),
    ],
)
def test_a_mistake_is_answered_with_one_line(words, code, message, capsys):
    assert cli.main(words) == code
    captured = capsys.readouterr()
    assert captured.err.strip().startswith(f"lerobot-bimanual: {message}")
    assert captured.err.strip().count("\n") == 0
    assert captured.out == ""


def test_a_termination_unwinds_the_command_in_silence(capsys):
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as exit_:
        cli.main(["greet", "--fail=by termination"])
    assert exit_.value.code == 143
    assert capsys.readouterr() == ("swept up\n", "")
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_reader_that_leaves_early_is_not_an_error():
    command = f"{sys.executable} -m lerobot_bimanual.cli --help | true"
    child = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert child.stderr == ""


def test_the_traceback_is_shown_on_demand(monkeypatch):
    monkeypatch.setenv("LEROBOT_BIMANUAL_TRACEBACK", "1")
    with pytest.raises(BimanualError, match="no one"):
        cli.main(["greet", "--fail=clearly"])


def test_a_function_without_a_config_is_not_a_command():
    def number(value: int) -> None: ...

    with pytest.raises(TypeError, match="number"):
        cli.config_type_of(number)


def test_installed_commands_show_their_help_without_loading_lerobot_or_torch():
    program = """
import json, sys
from lerobot_bimanual import cli
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
    assert all(summaries.values()), summaries
    assert not any(loads.values()), loads


def test_help_shows_long_examples_as_they_can_be_typed():
    """A backslash at the end of a line of a docstring joins two lines, unless the docstring is raw."""
    joined = {
        (name, line)
        for name, entry in cli.find_commands().items()
        for line in (inspect.getdoc(entry.load()) or "").splitlines()
        if re.search(r"\S {2,}\S", line)
    }
    assert not joined


def test_every_flag_of_every_installed_command_is_explained():
    unexplained = {
        (name, flag.name)
        for name, entry in cli.find_commands().items()
        for flag in flags_of(cli.config_type_of(entry.load()))
        if not field_comments(flag.owner).get(flag.name)
    }
    assert not unexplained
