"""Every command and program in the documents runs with little to do; `ELSEWHERE` says which do not."""

import re
import shutil
import sys
from pathlib import Path

import pytest
from documents import DOCUMENTS, ROOT, commands
from programs import run

PYTHON_BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
SMALLER: dict[str, str] = {
    **dict.fromkeys(("--episodes", "--eval.n_episodes", "--eval.batch_size", "--sample"), "1"),
    **dict.fromkeys(("--steps", "--save_freq"), "2"),
    "--episode_indices": "0:1",
    "--axes": "mass",
}
"""Values of flags that are given."""
TRAINING = ("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0", "--policy.device=cpu")
EVALUATION = ("--policy.device=cpu", "--eval.n_episodes=1", "--eval.batch_size=1")
EVALUATION += ("--env.image_size=32", "--env.max_keyposes=2")
FURTHER: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("lerobot-train", "lerobot-bimanual-train"), TRAINING),
    **dict.fromkeys(("lerobot-eval", "lerobot-bimanual-eval"), EVALUATION),
    "lerobot-bimanual-eval": (*EVALUATION, "--env.results_dir=outputs/records"),
    "dataset generate": ("--image_size=32", "--workers=1"),
    "expert evaluate": ("--episodes=1", "--open_loop_episodes=1", "--workers=1"),
    "policy benchmark": ("--dry_run",),
    "policy robustness": ("--axes=mass", "--levels=1", "--episodes=1"),
    **dict.fromkeys(("results verify", "results diagnose"), ("--sample=1", "--workers=1")),
}
"""Flags that are added unless they are given, by program or command."""
ELSEWHERE = {
    "make |source |set |[A-Z]+=|echo ": "of the shell, or they set this repository up",
    "pip |.*pre-commit|hf |.*dataset push|.*smolvla": "need the network",
    "ray |RAY|torchrun|lerobot-train --policy.type=peract2": "need machines or a GPU; test_generate.py has two machines",
    ".*(raise_block|my_task)": "need a task of one's own, of which test_examples.py has the same",
    "lerobot-(replay|rollout)|python -m lerobot|.*local/demonstrations": "robots/test_programs.py plays the same",
    "lerobot-bimanual results verify --results=results/leaderboard": "test_results.py replays an episode of drawn rows",
    "cd |PYTHONPATH": "test_vla_eval.py runs the harness",
    ".*(lerobot-bimanual results compare|rvt_lf_small|results/robustness)|.*tables.py": "need results of hours, or write here",
}
"""Commands that do not run here, and why."""
RESULT = "dual_push_buttons_peract_lf_small_seed1000_plans.json"
"""The only result for the commands that read the user's results; a replay of all takes ten minutes."""
ROW = "results/leaderboard/put_item_in_drawer_peract2_small_seed1000_on_all.json"
"""The only result for the commands that read the leaderboard; all of them take minutes."""
ROOM = {
    name: name for name in ("policies", "examples", "results/checkpoints", "results/expert_reports", ROW)
} | {
    "downloads/pretrained_model": "results/checkpoints/peract2_on_all",
    f"outputs/benchmark/results/{RESULT}": f"results/leaderboard/{RESULT}",
}
"""What is there before the first command."""


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_commands_and_programs_of_every_page_run(tmp_path: Path) -> None:
    for place, source in ROOM.items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).symlink_to(ROOT / source)
    # What these leave, others read.
    first = [ROOT / f"{name}.md" for name in ("README", "docs/training", "docs/failures")]
    pages = dict.fromkeys([*first, *DOCUMENTS, *sorted(ROOT.glob("examples/*.sh"))])
    for words in dict.fromkeys(tuple(small(words)) for words in commands(*pages)):
        if re.match("|".join(ELSEWHERE), " ".join(words)):
            continue
        for word in words:
            if word.startswith("--output_dir=") or (word.startswith("--root=") and "generate" in words):
                shutil.rmtree(tmp_path / word.partition("=")[2], ignore_errors=True)
        run(*words, folder=tmp_path)
    for page in ("README.md", "docs/environment.md", "docs/own_policy.md", "envs/README.md"):
        for program in PYTHON_BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
            run(sys.executable, "-c", program, folder=tmp_path)


def small(words: list[str]) -> list[str]:
    """The same command with little to do."""
    flags = {word.partition("=")[0] for word in words if "=" in word}
    further = [*FURTHER.get(words[0], ()), *FURTHER.get(" ".join(words[1:3]), ())]
    added = [flag for flag in further if flag.partition("=")[0] not in flags]
    fewer = {name: f"{name}={SMALLER[name]}" for name in flags if name in SMALLER}
    return [fewer.get(word.partition("=")[0], word) for word in words] + added
