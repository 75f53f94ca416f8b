"""The documents of the repository, the commands in them, and whether programs accept these."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flags import parse_flags

ROOT = Path(__file__).parents[2]
FOLDERS = ("", "docs/", "envs/", "policies/", "robots/", "examples/", "policies/lerobot_policy_bimanual/*/")
DOCUMENTS = sorted(path for place in (*FOLDERS, "results/checkpoints/") for path in ROOT.glob(f"{place}*.md"))
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)


def parse(program: str, *flags: str) -> Any:
    """The config that a program makes of its flags."""
    import draccus
    from lerobot.configs.eval import EvalPipelineConfig
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the environment

    if program == "lerobot-bimanual":
        name, rest = cli.find_command(flags)
        return parse_flags(cli.config_type_of(cli.find_commands()[name].load()), rest)
    if program == "lerobot-bimanual-eval":
        # The page about a task of one's own plays one that is not installed here.
        flags = ("--env.type=bimanual", *(flag.replace("=raise_block", "=lift_ball") for flag in flags))
    if any(flag.startswith("--policy.path=") for flag in flags):
        # LeRobot reads the policy's config from there and applies the other --policy flags to it.
        flags = tuple(flag for flag in flags if not flag.startswith(("--policy.", "--trust_")))
    config_type = EvalPipelineConfig if program.endswith("-eval") else TrainPipelineConfig
    return draccus.parse(config_type, args=flags, exit_on_error=False)


def commands(*documents: Path) -> Iterator[list[str]]:
    """Every command in shell blocks of documents and in shell scripts, as words; variables have their defaults."""
    for path in documents:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".md":
            text = "".join(SHELL_BLOCK.findall(text))
        for name, value in re.findall(r"^(\w+)=\$\{\1:-([^}]*)\}", text, re.MULTILINE):
            text = text.replace(f"${name}", value)
        text = re.sub(r"(^|\s)#.*$", "", text, flags=re.MULTILINE).replace("\\\n", " ")
        lexer = shlex.shlex(text, posix=True, punctuation_chars="\n;&|")
        lexer.whitespace, lexer.whitespace_split, lexer.commenters = " \t", True, ""
        command: list[str] = []
        for token in [*lexer, "\n"]:
            if set(token) <= set("\n;&|"):
                if command:
                    yield command
                command = []
            else:
                command.append(token)
