"""The commands of a page, and what makes each of them a small one: as it stands there, but for its numbers."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)

SMALLER = {
    "controls": "0",
    "env.image_size": "32",
    "env_eval_freq": "2",
    "episodes": "2",
    "eval.batch_size": "1",
    "eval.n_episodes": "1",
    "image_size": "32",
    "robot.image_size": "32",
    "sample": "1",
    "save_freq": "2",
    "steps": "2",
}
"""Values of flags that are there, by name."""

TRAINING = ("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0", "--policy.device=cpu")
FURTHER = {
    "lerobot-train": TRAINING,
    "lerobot-bimanual-train": TRAINING,
    "lerobot-eval": ("--policy.device=cpu", "--eval.n_episodes=1", "--eval.batch_size=1"),
    "policy benchmark": (
        "--demos=2",
        "--image_size=32",
        "--steps=2",
        "--save_freq=2",
        "--val_episodes=0",
        "--test_episodes=1",
        "--eval_flags=--eval.batch_size=1",
        "--device=cpu",
    ),
    "results diagnose": ("--sample=1",),
    "expert evaluate-perturbed": ("--seeds=61000:61001", "--blind_seeds=61000:61001", "--levels=1"),
    "dataset generate": ("--episodes=2", "--image_size=32"),
    "policy robustness": ("--axes=mass", "--levels=1", "--episodes=2", "--batch_size=1"),
    "results verify": ("--sample=1", "--controls=0"),
}
"""Flags that are added where they are not there, by program or command."""


def commands(page: Path) -> list[list[str]]:
    """Every command of a page's shell blocks, as words."""
    text = "".join(SHELL_BLOCK.findall(page.read_text(encoding="utf-8"))).replace("\\\n", " ")
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    return [words for words in lines if words]


def small(words: list[str]) -> list[str]:
    """The same with little to do."""
    named = {word.partition("=")[0] for word in words}
    further = [flag for name in (words[0], " ".join(words[1:3])) for flag in FURTHER.get(name, ())]
    return [_small(word) for word in words] + [
        flag for flag in further if flag.partition("=")[0] not in named
    ]


def _small(word: str) -> str:
    name, equals, value = word.removeprefix("--").partition("=")
    if name in ("seeds", "episodes") and ":" in value:
        first = int(value.partition(":")[0])
        return f"--{name}={first}:{first + 2}"
    return f"--{name}={SMALLER.get(name, value)}" if equals and word.startswith("--") else word


def run(words: list[str], folder: Path) -> None:
    """Run a command in a folder, with the programs of this environment and without the Hub."""
    programs = Path(sys.executable).parent
    done = subprocess.run(
        [programs / words[0] if (programs / words[0]).exists() else words[0], *words[1:]],
        cwd=folder,
        env=os.environ | {"HF_HUB_OFFLINE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
