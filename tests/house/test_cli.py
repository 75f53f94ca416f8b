"""The command line: groups of commands, their help, exit codes, flags, and one line for every mistake."""

import dataclasses
import io
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flags import BadCommandLine, describe_flags, field_comments, flags_of, parse_flags
from lerobot_bimanual.cli.lerobot_program import Filtered
from lerobot_bimanual.interrupts import signal_handled

COMMAND = '''
from dataclasses import dataclass
from lerobot_bimanual.errors import BimanualError

@dataclass
class GreetConfig:
    name: str = "you"  # who is greeted
    fail: str = ""  # how to fail

def greet(config: GreetConfig) -> int | None:
    """Say hello.

    Examples:
        lerobot-bimanual greet --name=all
    """
    if config.fail == "clearly":
        raise BimanualError("there is no one to greet")
    if config.fail == "by interrupt":
        raise KeyboardInterrupt("the same command goes on")
    if config.fail.startswith("by SIG"):
        import os, signal
        os.kill(os.getpid(), getattr(signal, config.fail.removeprefix("by ")))
    print("hello", config.name)
    return 5
'''
CONFIGS = {name: cli.config_type_of(entry.load()) for name, entry in cli.find_commands().items()}


@pytest.fixture
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


def test_help_lists_commands_by_section_and_group_without_importing_them(greeting, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["lerobot-bimanual", "reading summaries"])
    assert cli.main(["help"]) == cli.main([]) == 0
    out = capsys.readouterr().out
    sections = ["start", "data", "train and score", "maintain", "more"]
    assert re.findall(r"^([a-z ]+):$", out, re.M) == 2 * sections
    assert re.search(r"\nmore:\n  greet +Say hello\.\n", out)
    assert "greeting_commands" not in sys.modules
    assert cli.main(["dataset"]) == 0
    found = re.findall(r"^  dataset (\w+)  ", capsys.readouterr().out, re.M)
    assert found == ["generate", "push", "verify"]


def test_help_of_a_command_shows_its_text_flags_and_examples(greeting, capsys):
    for words in (["greet", "--help"], ["help", "greet"]):
        assert cli.main(words) == 0
        out = capsys.readouterr().out
        assert "--name=text               who is greeted (default: you)" in out
        assert out.endswith("examples:\n  lerobot-bimanual greet --name=all\n")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["greed"], 2, "unknown command 'greed'. Did you mean 'greet'? Commands: dataset, "),
        (["dataset", "verfy"], 2, "unknown command 'dataset verfy'. Did you mean 'dataset verify'? "),
        (["greet", "--nam=x"], 2, "unknown flag --nam. Did you mean '--name'? Valid flags: --name, --fail."),
        (["greet", "--fail=clearly"], 1, "there is no one to greet"),
        (["greet", "--fail=by interrupt"], 130, "interrupted; the same command goes on"),
    ],
)
def test_a_mistake_is_answered_with_one_line(words, code, message, greeting, capsys):
    assert cli.main(words) == code
    captured = capsys.readouterr()
    assert captured.err.strip().startswith(f"lerobot-bimanual: {message}")
    assert (captured.err.strip().count("\n"), captured.out) == (0, "")


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_command_returns_its_exit_code_and_unwinds_when_it_is_ended(name, greeting, capsys):
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with pytest.raises(SystemExit) as exit_:
        cli.main(["greet", f"--fail=by {name}"])
    assert exit_.value.code == 128 + number
    assert capsys.readouterr() == ("", "")
    assert signal.getsignal(number) is before
    with signal_handled(number, signal.SIG_IGN):  # as by nohup
        assert cli.main(["greet", "--name=Ada", f"--fail=by {name}"]) == 5
    assert capsys.readouterr().out == "hello Ada\n"


@pytest.mark.parametrize(
    ("name", "reader", "shown", "code"),
    [
        ("Zoë", "cat", b"hello Zo?\n", 5),
        ("Ada", "true", b"", 5),  # its work is done
        (100_000 * "A", "true", b"", 128 + signal.SIGPIPE),
    ],
    ids=["ASCII", "after the work", "within the work"],
)
def test_ascii_terminals_and_closed_pipes_cause_no_traceback(name, reader, shown, code, greeting, tmp_path):
    program = f"(sleep 0.3; exec {sys.executable} -m lerobot_bimanual.cli greet --name={name}) | {reader}"
    program += "; exit ${PIPESTATUS[0]}"
    env = os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONIOENCODING": "ascii", "PYTHONUNBUFFERED": ""}
    child = subprocess.run(["bash", "-c", program], capture_output=True, env=env, check=False)
    assert (child.stdout, child.stderr, child.returncode) == (shown, b"", code)


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_a_command_whose_output_is_closed_does_its_work(closed, greeting, tmp_path):
    program = f"exec {sys.executable} -m lerobot_bimanual.cli greet {closed}"
    assert subprocess.call(["bash", "-c", program], env=os.environ | {"PYTHONPATH": str(tmp_path)}) == 5


@pytest.mark.parametrize(
    ("progress", "shown"), [(False, "one\nthree\n"), (True, "one\nINFO two\n\r 50%|\nthree\n")]
)
def test_what_a_program_of_lerobot_prints_stays_in_lines(progress, shown):
    stream = io.StringIO()
    filtered: Any = Filtered(stream, progress)
    for text in ("one", "INFO two", "\r 50%|", "1\n2\n3\n4\n5", "three"):
        print(text, file=filtered)
    assert stream.getvalue() == shown


def test_installed_commands_show_their_help_without_loading_lerobot_or_torch():
    program = """
import json, sys
from lerobot_bimanual import cli
from lerobot_bimanual.cli.command_line import summary
summaries = {name: summary(entry) for name, entry in cli.find_commands().items()}
cli.main(["--help"])
assert not {"torch", "lerobot", "mujoco", "draccus", "numpy", "gymnasium", "rich"} & set(sys.modules)
loads = {name: cli.main([*name.split(), "--help"]) or sorted({"torch", "lerobot"} & {*sys.modules}) for name in summaries}
print(json.dumps([summaries, loads]))
"""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    summaries, loads = json.loads(child.stdout.splitlines()[-1])
    assert all(summaries.values()), summaries
    assert not any(loads.values()), loads


@pytest.mark.parametrize("command", CONFIGS)
def test_every_flag_is_explained_and_means_the_same_as_in_other_commands(command):
    defaults = dict.fromkeys(("sample", "sample_seed", "workers", "first_seed"), 0)
    defaults |= {"variation": "any", "split": "test", "perturb": "", "episodes": 100, "task": "all"}
    exceptions: dict[tuple[str, str], object] = {("dataset generate", "split"): "train"}
    exceptions |= {("task view", "episodes"): 1}  # pictures of each
    exceptions[("policy robustness", "episodes")] = 20  # of some sixty conditions
    of_protocol = ("variation", "perturb", "first_seed")
    exceptions |= {("policy benchmark", name): None for name in of_protocol}
    one_task = ("policy benchmark", "task view")
    exceptions |= {(command, "task"): "lift_ball" for command in one_task}
    required = ("dataset generate", "policy robustness")  # hours of work
    exceptions |= {(command, "task"): dataclasses.MISSING for command in required}
    exceptions |= {(f"{what} verify", "sample_seed"): None for what in ("dataset", "results")}  # drawn anew
    kinds = {"root": Path, "checkpoint": Path, "output": Path, "results": Path, "expert_reports": Path}
    kinds |= {"task": str, "episodes": int, "first_seed": int, "seed": int, "device": str}
    forbidden = {"dataset", "seeds", "size", "films", "film", "videos", "certificates", "control", "figure"}
    for flag in flags_of(CONFIGS[command]):
        assert field_comments(CONFIGS[command]).get(flag.name), flag.name
        assert flag.name not in forbidden
        assert flag.kind is kinds.get(flag.name, flag.kind), flag.name
        default = exceptions.get((command, flag.name), defaults.get(flag.name, flag.default))
        assert flag.default == default, flag.name
        assert flag.name != "seed" or command == "policy benchmark"


@dataclass
class Base:
    name: str = "0:10"  # half-open range


@dataclass
class Config(Base):
    view: Literal["frames", "keyframes"] = "frames"  # 100 % of the frames, or some
    # Several lines above
    # count as one text.
    output: Path | None = None
    cameras: tuple[str, ...] = ("front",)  # by name
    fractions: tuple[float, ...] = ()  # by default all
    workers: int = 1  # processes
    size: int | str = 256  # side in pixels, or HEIGHTxWIDTH
    force: bool = False  # for sure


@dataclass
class Needy:
    output: Path = field(kw_only=True)  # where to


@pytest.mark.parametrize("text", ["1:20", "010", "1e3", "true", "null", "a, b: c", '"', "include /dev/zero"])
def test_texts_arrive_as_they_were_typed(text):
    assert parse_flags(Config, [f"--name={text}"]).name == parse_flags(Config, ["--name", text]).name == text


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], Config()),
        (["--view=keyframes", "--output=7"], Config(view="keyframes", output=Path("7"))),
        (["--output=null"], Config(output=None)),
        (["--cameras=front, left_wrist"], Config(cameras=("front", "left_wrist"))),
        (["--cameras="], Config(cameras=())),
        (["--fractions=[0.35, 1]"], Config(fractions=(0.35, 1.0))),
        (["--size=64", "--workers", "-3"], Config(size=64, workers=-3)),
        (["--force", "--workers=2"], Config(force=True, workers=2)),
        (["--force", "false"], Config(force=False)),
    ],
)
def test_flags_fill_the_dataclass(words, expected):
    assert parse_flags(Config, words) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["frames"], "'frames' is not a flag"),
        (["--workers"], "flag --workers needs a value"),
        (["--workers=two"], "--workers is 'two', but must be an integer"),
        (["--view=keyframe"], "--view is 'keyframe', but must be one of: frames, keyframes. Did you mean"),
        (["--no\nflag=1"], "unknown flag --no\\nflag."),
    ],
)
def test_mistakes_name_what_is_wrong_and_what_is_valid(words, message):
    with pytest.raises(BadCommandLine) as error:
        parse_flags(Config, words)
    assert message in str(error.value)
    with pytest.raises(BadCommandLine, match=r"missing: --output=path\. `--help` explains every flag"):
        parse_flags(Needy, [])


def test_help_comes_from_comments_beside_and_above_the_fields():
    text = describe_flags(Config)
    for line in (
        "--name=text               half-open range (default: 0:10)",
        "--view=frames|keyframes   100 % of the frames, or some (default: frames)",
        "--output=path             Several lines above count as one text. (default: none)",
        "--fractions=a,b,...       by default all",
    ):
        assert f"{line}\n" in f"{text}\n"
    assert "--output=path             where to (required)" in describe_flags(Needy)
