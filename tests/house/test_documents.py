"""Commands, tables and links in the documents are true."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flags import parse_flags

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(
    path
    for folder in (
        ".",
        "docs",
        "envs",
        "policies",
        "robots",
        "examples",
        "policies/lerobot_policy_bimanual/*",
        "results/checkpoints",
    )
    for path in ROOT.glob(f"{folder}/*.md")
)
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def commands(program: str) -> Iterator[tuple[str, list[str]]]:
    """Every call of a program in a shell block of a document or in an example, as (place, words after it)."""
    texts = [(path, block) for path in DOCUMENTS for block in SHELL_BLOCK.findall(path.read_text())]
    texts += [(path, path.read_text()) for path in sorted(ROOT.glob("examples/*.sh"))]
    for path, text in texts:
        for name, value in re.findall(r"^(\w+)=\$\{\1:-([^}]*)\}", text, re.MULTILINE):
            text = text.replace(f"${name}", value)
        text = re.sub(r"(^|\s)#.*$", "", text, flags=re.MULTILINE).replace("\\\n", " ")
        lexer = shlex.shlex(text, posix=True, punctuation_chars="\n;&|")
        lexer.whitespace, lexer.whitespace_split, lexer.commenters = " \t", True, ""
        command: list[str] = []
        for token in [*lexer, "\n"]:
            if set(token) <= set("\n;&|"):
                if command[:1] == ["torchrun"]:  # several processes of the program that a later word names
                    command = [program, *command[3:]] if program in command[2] else []
                if command and command[0] == program:
                    yield path.name, command[1:]
                command = []
            else:
                command.append(token)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files(document: Path) -> None:
    assert not [link for link in LINK.findall(document.read_text()) if not (document.parent / link).exists()]


def test_the_readme_names_every_command_and_no_other() -> None:
    rows = re.findall(
        r"^\| `([a-z -]+)` \|", (ROOT / "README.md").read_text().partition("## Command line")[2], re.M
    )
    assert sorted(rows) == list(cli.find_commands())


def test_flags_of_our_commands_parse() -> None:
    found = list(commands("lerobot-bimanual"))
    assert len(found) > 5
    for _, words in found:
        name, flags = cli.find_command(words)
        parse_flags(cli.config_type_of(cli.find_commands()[name].load()), flags)


def test_every_page_is_in_the_navigation_of_the_site() -> None:
    import yaml

    def pages(entry: Any) -> Iterator[str]:
        if isinstance(entry, str):
            yield entry
        else:
            for part in entry.values() if isinstance(entry, dict) else entry:
                yield from pages(part)

    named = set(pages(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]))
    assert {path.name for path in ROOT.glob("docs/*.md")} <= named


def test_make_knows_every_target_that_is_named() -> None:
    named = {word for _, words in commands("make") for word in words}
    assert {"setup", "demo", "test", "check"} <= named
    subprocess.run(["make", "--dry-run", *sorted(named)], cwd=ROOT, check=True, capture_output=True)


@pytest.mark.parametrize("program", ["lerobot-train", "lerobot-bimanual-train", "lerobot-eval"])
def test_flags_of_lerobots_commands_parse(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import draccus
    from lerobot.configs.eval import EvalPipelineConfig
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the environment

    config_type = EvalPipelineConfig if program == "lerobot-eval" else TrainPipelineConfig
    found = list(commands(program))
    assert found
    for _, flags in found:
        if any(flag.startswith("--policy.path=") for flag in flags):
            # LeRobot reads the policy's config from there and applies the other --policy flags to it.
            flags = [flag for flag in flags if not flag.startswith("--policy.")]
        monkeypatch.chdir(ROOT)  # where recipes are
        draccus.parse(config_type, args=flags, exit_on_error=False)


def test_the_task_table_of_the_readme_is_the_registry() -> None:
    from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

    specs = sorted((get_task(name).spec for name in list_tasks()), key=lambda spec: spec.id)
    rows = [
        f"| `{spec.name}` | {spec.instructions[0]} | {len(spec.variations)} | {', '.join(spec.taxonomy.suites)} |"
        for spec in specs
    ]
    section = (ROOT / "README.md").read_text().partition("## Tasks\n")[2].partition("\n## ")[0]
    shown = [line for line in section.splitlines() if line.startswith("| `")]
    assert shown == rows, "\n".join(["the table of tasks in README.md should be", *rows])


def test_the_table_of_the_schema_names_every_column() -> None:
    from lerobot_bimanual.dataset import schema

    text = (ROOT / "docs/schema.md").read_text()
    for key, elements in schema.VECTORS.items():
        assert f"| `{key}` | ({len(elements)},) |" in text
    assert all(re.search(rf"^\|.*`{key}`.* \| \(1,\) \|", text, re.MULTILINE) for key in schema.SCALARS)


def test_the_table_of_options_is_that_of_the_environment() -> None:
    from dataclasses import fields

    from lerobot_env_bimanual import BimanualEnvConfig
    from lerobot_env_bimanual.options import EnvOptions

    section = (ROOT / "docs/environment.md").read_text().partition("## Options\n")[2]
    shown = dict(re.findall(r"^\| `(\w+)` \| `([^`]*)` \|", section, re.MULTILINE))
    options = {field.name: str(field.default) for field in fields(EnvOptions)}
    assert shown == {"task": str(BimanualEnvConfig().task)} | options


def test_the_table_of_cameras_is_the_scene() -> None:
    from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS

    text = (ROOT / "docs/environment.md").read_text()
    for camera in FIXED_CAMERAS:
        places = " | ".join(
            ", ".join(f"{value:.2f}" for value in place) for place in (camera.position, camera.target)
        )
        assert f"| `{camera.name}` | {places} | {camera.fovy_deg:g}° |" in text


def test_tables_of_pages_are_those_of_the_board_and_the_registry() -> None:
    tables = script("tables")
    for name, (place, _) in tables.TABLES.items():
        page = (ROOT / place).read_text(encoding="utf-8")
        assert tables.with_table(page, name) == page, "run scripts/tables.py"


def script(name: str) -> Any:
    """A script as a module; those that it imports lie beside it."""
    import importlib

    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(ROOT / "scripts"))
