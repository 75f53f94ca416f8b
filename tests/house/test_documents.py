"""Commands, tables and links in the documents are true."""

import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flags import parse_flags

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(
    path
    for folder in (".", "docs", "envs", "policies", "examples", "policies/lerobot_policy_bimanual/*")
    for path in ROOT.glob(f"{folder}/*.md")
)
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]+)\)")


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
                if command and command[0] == program:
                    yield path.name, command[1:]
                command = []
            else:
                command.append(token)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files(document: Path) -> None:
    assert not [link for link in LINK.findall(document.read_text()) if not (document.parent / link).exists()]


def test_the_readme_names_every_verb_and_no_other() -> None:
    rows = re.findall(
        r"^\| `([a-z-]+)` \|", (ROOT / "README.md").read_text().partition("## Command line")[2], re.M
    )
    assert sorted(rows) == list(cli.find_verbs())


def test_flags_of_our_verbs_parse() -> None:
    found = list(commands("lerobot-bimanual"))
    assert len(found) > 5
    for place, (verb, *flags) in found:
        assert verb in cli.find_verbs(), place
        config_type = cli.config_type_of(cli.find_verbs()[verb].load())
        parse_flags(config_type, flags)


def test_make_knows_every_target_that_is_named() -> None:
    named = {word for _, words in commands("make") for word in words}
    assert {"setup", "demo", "test", "check"} <= named
    subprocess.run(["make", "--dry-run", *sorted(named)], cwd=ROOT, check=True, capture_output=True)


@pytest.mark.parametrize("program", ["lerobot-train", "lerobot-eval"])
def test_flags_of_lerobots_commands_parse(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import draccus
    from lerobot.configs.eval import EvalPipelineConfig
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the environment

    config_type = {"lerobot-train": TrainPipelineConfig, "lerobot-eval": EvalPipelineConfig}[program]
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


def test_the_dataset_table_of_the_readme_is_the_schema() -> None:
    from lerobot_bimanual.dataset import schema

    text = (ROOT / "README.md").read_text()
    for key, elements in schema.VECTORS.items():
        assert f"| `{key}` | ({len(elements)},) |" in text
