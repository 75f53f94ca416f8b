"""The commands of the README, run one after the other as they stand there, but for numbers that make them small."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

ROOT = Path(__file__).parents[2]
SHELL_BLOCK = re.compile(r"```bash\n(.*?)```", re.DOTALL)
ELSEWHERE = ("make", "source")
"""The targets of `make` have tests and a place in CI of their own."""

SMALLER = {
    "episodes": "2",
    "image_size": "32",
    "env.image_size": "32",
    "eval.n_episodes": "1",
    "eval.batch_size": "1",
}
FURTHER = {
    "lerobot-train": [
        "--steps=2",
        "--save_freq=2",
        "--batch_size=2",
        "--num_workers=0",
        "--policy.device=cpu",
    ],
    "lerobot-eval": ["--policy.device=cpu"],
    "benchmark": [
        "--demos=2",
        "--image_size=32",
        "--steps=2",
        "--save_freq=2",
        "--val_episodes=0",
        "--test_episodes=1",
        "--eval_flags=--eval.batch_size=1",
        "--device=cpu",
    ],
}


def commands() -> list[list[str]]:
    """Every command of the README, as words."""
    text = "".join(SHELL_BLOCK.findall((ROOT / "README.md").read_text(encoding="utf-8"))).replace("\\\n", " ")
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    return [words for words in lines if words and words[0] not in ELSEWHERE]


def small(words: list[str]) -> list[str]:
    """The same with little to do."""
    return [_small(word) for word in words] + FURTHER.get(words[0], []) + FURTHER.get(words[1], [])


def _small(word: str) -> str:
    name, equals, value = word.removeprefix("--").partition("=")
    if name == "seeds":
        first = int(value.partition(":")[0])
        value = f"{first}:{first + 2}"
    return f"--{name}={SMALLER.get(name, value)}" if equals else word


def test_the_commands_of_the_readme_run_in_their_order(tmp_path: Path) -> None:
    for name in ("policies", "results"):
        (tmp_path / name).symlink_to(ROOT / name)
    found = commands()
    assert len(found) >= 8
    for words in found:
        program, *flags = small(words)
        done = subprocess.run(
            [Path(sys.executable).with_name(program), *flags],
            cwd=tmp_path,
            env=os.environ | {"HF_HUB_OFFLINE": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
