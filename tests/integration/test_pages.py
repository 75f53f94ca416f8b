"""The commands of the pages in docs/, run with numbers that make them small, or with the reason why not."""

import re
import shlex
import shutil
import sys
from pathlib import Path

import draccus
import pytest
from lerobot.configs.train import TrainPipelineConfig
from lerobot.utils.import_utils import register_third_party_plugins
from small_commands import ROOT, commands, run, small

ORDER = (
    "datasets",
    "determinism",
    "hardware",
    "training",
    "benchmark",
    "policies",
    "learning",
    "results",
    "robustness",
)
"""Pages that use files of others come after them; the rest follow by name."""

NOT_RUN = {
    r"benchmarks/gpu_train\.sh": "needs a GPU; test_gpu_train_script.py runs it with programs that pretend",
    r".*scripts/board\.sh": "writes into the repository; test_benchmark.py runs it elsewhere",
    r"pip install": "changes this environment",
    r"hf auth login": "asks for a token",
    r"lerobot-bimanual (dataset push|dataset generate) .*--repo_id=me/.*": "uploads; test_hub.py does to a loopback Hub",
    r"ray start|lerobot-bimanual dataset generate .*--executor=ray": "needs several machines; test_generate_ray.py takes one",
    r"torchrun": "needs several processors; its flags are read here, and test_lerobot_train.py trains with one",
    r"hf upload": "uploads",
    r".*vla-eval run": "needs a model server; test_vla_eval.py has one",
    r".*smolvla": "downloads weights",
    r"lerobot-(teleoperate|record) ": "needs hands at a keyboard; tests/robots has its own",
    r"lerobot-train .*local/by_hand|lerobot-rollout": "of what such hands have recorded; tests/robots has its own",
    r"python examples/11_subtask_policy\.py|lerobot-bimanual-train --policy\.path=outputs/dit": (
        "needs a CLIP; test_subtasks.py makes one"
    ),
    r"python -m lerobot\.async_inference": "a server that does not end; tests/robots serves one",
    r"lerobot-bimanual policy accuracy .*push_box_val": "of a policy that is trained for longer; test_inspect.py has a small one",
    r"lerobot-bimanual results compare .*outputs/ladder/": "of two long ladders; tests/envs/test_ladder.py has small ones",
}
"""By the beginning of the command."""

PLANNED = re.compile(r"--device=cuda|--trained_on=|--steps=|--seed=|^(?!.*--output=).*--first_seed=")
"""Benchmarks with these flags are planned only (`--dry_run`), as one like them has been run before.

Other seeds are run where the page gives them a folder of their own: the default folder has those of the first page.
"""


def pages() -> list[Path]:
    """Pages with commands, in the order in which they are read here."""
    found = sorted(
        (ROOT / "docs").glob("*.md"), key=lambda page: (*(page.stem != name for name in ORDER), page.stem)
    )
    return [page for page in found if commands(page)]


def reason(words: list[str]) -> str | None:
    """Why a command is not run; None for one that is."""
    return next((why for start, why in NOT_RUN.items() if re.match(start, shlex.join(words))), None)


def test_every_reason_is_one_of_a_command() -> None:
    found = [shlex.join(words) for page in pages() for words in commands(page)]
    assert [start for start in NOT_RUN if not any(re.match(start, line) for line in found)] == []


def test_what_a_command_reads_in_results_is_there() -> None:
    found = [word for page in pages() for words in commands(page) for word in words if "=results/" in word]
    assert found
    assert [word for word in found if not (ROOT / word.partition("=")[2]).exists()] == []


def test_lerobot_accepts_the_flags_of_trainings_on_several_gpus(monkeypatch: pytest.MonkeyPatch) -> None:
    register_third_party_plugins()
    found = [words for page in pages() for words in commands(page) if words[0] in ("torchrun", "accelerate")]
    assert found
    for words in found:
        program = next(index for index, word in enumerate(words) if "lerobot-train" in word)
        flags = [*words[program + 1 :], "--policy.device=cpu"]
        monkeypatch.setattr(sys, "argv", ["lerobot-train", *flags])
        draccus.parse(TrainPipelineConfig, args=flags).validate()


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_commands_of_the_pages_run(tmp_path: Path) -> None:
    _lay_out(tmp_path)
    found = [(page, words) for page in pages() for words in commands(page) if reason(words) is None]
    assert len(found) >= 30
    found.sort(
        key=lambda command: command[1][1:3] == ["results", "compare"]
    )  # what it compares comes later on the page
    for page, words in found:
        command = small(words)
        if words[1:3] == ["policy", "benchmark"] and PLANNED.search(shlex.join(words)):
            command = [*words, "--dry_run"]
        try:
            run(command, tmp_path)
        except AssertionError as error:
            error.add_note(f"of {page.name}")
            raise


def _lay_out(folder: Path) -> None:
    """What the pages take to be there: parts of the repository, a trained policy, two rows."""
    for name in ("examples", "policies"):
        (folder / name).symlink_to(ROOT / name)
    trained = folder / "outputs/peract2/checkpoints/last"
    trained.mkdir(parents=True)
    (folder / "downloads").mkdir()
    for link in (trained / "pretrained_model", folder / "downloads/pretrained_model"):
        link.symlink_to(ROOT / "results/checkpoints/peract2_on_all")
    rows = folder / "results/leaderboard"
    rows.mkdir(parents=True)
    for found in (ROOT / "results").iterdir():
        if found.name != rows.name:
            (folder / "results" / found.name).symlink_to(found)
    for row in (ROOT / "results/leaderboard").glob("lift_ball_*.json"):
        shutil.copy(row, rows)
