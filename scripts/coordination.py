"""Write docs/hands.md: how much each keypose of each arm varies, and what shifted hands cost the expert.

It runs on one core.
Usage: coordination.py [--task=lift_ball,push_box] [--episodes=8]
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.files import write_file
from lerobot_bimanual.geometry.rotations import rotation_angle_rad
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, QUATERNION
from lerobot_bimanual.pages import markdown_table
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.baselines import demonstrations
from lerobot_env_bimanual.experts.runner import Move, Player, expert, run_episode
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import resolve_tasks

ROOT = Path(__file__).parents[1]
SHIFTS_CM = (1, 2, 3, 4)
WAYS = {"same way": 1, "opposite ways": -1}
"""Sign of the right hand's shift."""
FIRST_SEED = 900_000
PAGE = """# How much both hands have to look

Written by `python scripts/coordination.py`; do not edit.

*Keyposes* says how much each keypose of each arm varies over 100 training demonstrations of a task's first variation: the standard
deviation of its place in cm, and the root mean square of its rotation from the mean in degrees, both from the least to the most of
any keypose. A hand whose keyposes never vary needs no images. *Shifted hands* says how many of {episodes} test episodes the expert solves if
all keyposes are shifted along the table by 1 to 4 cm, in a direction drawn per episode: of both hands the same way, and of the right
hand the opposite way.
"""


def main() -> None:
    """Write the page of the chosen tasks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="all", help="tasks and suites, separated by commas")
    parser.add_argument("--episodes", type=int, default=8, help="per shift; 0 leaves shifted hands out")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/hands.md")
    options = parser.parse_args()
    page = PAGE.format(episodes=options.episodes)
    for setting in SETTINGS:
        tasks = resolve_tasks(options.task)
        spreads = [row for task in tqdm(tasks, f"{setting}: keyposes") for row in spread(task, setting)]
        page += f"\n## Keyposes in `{setting}`\n\n{markdown_table(pd.DataFrame(spreads))}\n"
        if options.episodes:
            rows = [shifted(task, setting, options.episodes) for task in tqdm(tasks, f"{setting}: shifts")]
            page += f"\n## Shifted hands in `{setting}`\n\n{markdown_table(pd.DataFrame(rows))}\n"
    write_file(options.output, page)


def spread(task: str, setting: str) -> Iterator[dict[str, str]]:
    """Of each arm, how much each keypose varies over training episodes: its place, and its rotation."""
    known = [keyposes for _, keyposes in demonstrations(task, 0, setting)]
    usual, _ = Counter(map(len, known)).most_common(1)[0]
    stacked = np.stack([keyposes for keyposes in known if len(keyposes) == usual]).astype(np.float64)
    arms = stacked.reshape(len(stacked), usual, len(ARMS), ARM_KEYPOSE_DIM)
    for arm in ARMS:
        keyposes = arms[:, :, arm.ordinal]
        cm = 100 * np.linalg.norm(keyposes[..., :3].std(axis=0), axis=-1)
        degrees = [_turned_deg(keyposes[:, index, QUATERNION]) for index in range(usual)]
        yield {
            "task": f"`{task}`",
            "arm": arm.value,
            "place, cm": f"{min(cm):.1f} to {max(cm):.1f}",
            "rotation, degrees": f"{min(degrees):.0f} to {max(degrees):.0f}",
        }


def _turned_deg(quats_wxyz: NDArray[np.float64]) -> float:
    """Root mean square angle (degrees) between rotations (n, 4) and their mean."""
    mean = np.linalg.eigh(quats_wxyz.T @ quats_wxyz).eigenvectors[:, -1]
    return float(np.rad2deg(np.sqrt(np.mean([rotation_angle_rad(each, mean) ** 2 for each in quats_wxyz]))))


def shifted(task: str, setting: str, episodes: int) -> dict[str, str]:
    """Successes of the expert with shifted hands, for each way and shift."""
    env = BimanualEnv(task, split="test", obs="state", control_mode="keypose", setting=setting)
    row, seeds = {"task": f"`{task}`"}, range(FIRST_SEED, FIRST_SEED + episodes)
    for way, sign in WAYS.items():
        solved = [
            sum(run_episode(env, seed, _shifted(seed, cm, sign)).success for seed in seeds)
            for cm in SHIFTS_CM
        ]
        row[way] = ", ".join(map(str, solved))
    env.close()
    return row


def _shifted(seed: int, shift_cm: int, right_sign: int) -> Player:
    """The expert with all keyposes of an episode shifted one way, drawn from the seed; the right hand's by `right_sign` times that."""
    angle_rad = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    shift_m = shift_cm / 100 * np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])

    def play(env: BimanualEnv) -> Iterator[Move]:
        for move in expert()(env):
            action = move.action.copy()
            action[:3] += shift_m
            action[ARM_KEYPOSE_DIM : ARM_KEYPOSE_DIM + 3] += right_sign * shift_m
            yield Move(move.name, action, move.presses)

    return play


if __name__ == "__main__":
    main()
