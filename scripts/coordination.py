"""Print two tables of tasks: how much each keypose of each arm varies, and what shifted hands cost the expert.

Usage: coordination.py --task=lift_ball,push_box --setting=varied --episodes=8
"""

import argparse
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import rotation_angle_rad
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, QUATERNION
from lerobot_bimanual.pages import markdown_table
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.nearest import demonstrations
from lerobot_env_bimanual.experts.runner import Move, Player, expert, run_episode
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import resolve_tasks

SHIFTS_CM = (1, 2, 3, 4)
FIRST_SEED = 900_000


def main() -> None:
    """Print the tables of the chosen tasks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="all", help="tasks and suites, separated by commas")
    parser.add_argument("--setting", choices=list(SETTINGS), default="standard")
    parser.add_argument("--episodes", type=int, default=8, help="per shift; 0 leaves the second table out")
    options = parser.parse_args()
    tasks = resolve_tasks(options.task)
    print(markdown_table(pd.DataFrame([row for task in tasks for row in spread(task, options.setting)])))
    if options.episodes:
        rows = [sensitivity(task, options.setting, options.episodes) for task in tasks]
        print(markdown_table(pd.DataFrame(rows)))


def spread(task: str, setting: str) -> Iterator[dict[str, str]]:
    """Of each arm, the standard deviation of each keypose over training episodes: of its place, and of its rotation."""
    known = [keyposes for _, keyposes in demonstrations(task, 0, setting)]
    usual, _ = Counter(map(len, known)).most_common(1)[0]
    stacked = np.stack([keyposes for keyposes in known if len(keyposes) == usual]).astype(np.float64)
    arms = stacked.reshape(len(stacked), usual, len(ARMS), ARM_KEYPOSE_DIM)
    for arm in ARMS:
        keyposes = arms[:, :, arm.ordinal]
        cm = 100 * np.linalg.norm(keyposes[..., :3].std(axis=0), axis=-1)
        degrees = [_turned_deg(keyposes[:, index, QUATERNION]) for index in range(usual)]
        cells = (f"{one_cm:.1f} cm, {turn:.0f}°" for one_cm, turn in zip(cm, degrees, strict=True))
        yield {"task": f"`{task}`", "arm": arm.value, "keyposes": "; ".join(cells)}


def _turned_deg(quats_wxyz: NDArray[np.float64]) -> float:
    """Root mean square angle (degrees) between rotations (n, 4) and their mean."""
    mean = np.linalg.eigh(quats_wxyz.T @ quats_wxyz).eigenvectors[:, -1]
    return float(np.rad2deg(np.sqrt(np.mean([rotation_angle_rad(each, mean) ** 2 for each in quats_wxyz]))))


def sensitivity(task: str, setting: str, episodes: int) -> dict[str, str]:
    """Successes of the expert whose hands are shifted along the table, both the same way / opposite ways."""
    env = BimanualEnv(task, obs="state", control_mode="keypose", setting=setting)
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)

    def solved(shift_cm: int, right_sign: int) -> int:
        return sum(run_episode(env, seed, _shifted(seed, shift_cm, right_sign)).success for seed in seeds)

    counts = {f"{cm} cm": f"{solved(cm, 1)} / {solved(cm, -1)}" for cm in SHIFTS_CM}
    return {"task": f"`{task}`", "episodes": str(episodes), **counts}


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
