"""The documents of the repository, and the commands in them."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("", "docs/", "envs/", "policies/", "robots/", "examples/", "policies/lerobot_policy_bimanual/*/")
DOCUMENTS = sorted(
    path for folder in (*FOLDERS, "results/checkpoints/") for path in ROOT.glob(f"{folder}*.md")
)
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)


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
