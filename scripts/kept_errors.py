"""Print how far a keypose policy's hands are from the expert's at the first two keyposes, and whether the second repeats the first.

The recorded keyposes of each episode are compared with those of the expert in the same scene; hands that are further off than
OUTLIER_CM went elsewhere, and hands that the expert does not move are left out. A correlation near 1 says that the second
keypose is as far off as the first one, the same way.
Usage: kept_errors.py --results=results/leaderboard [--policy=peract2]
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM
from lerobot_bimanual.results.record import result_paths
from lerobot_env_bimanual.experts.baselines import rehearsed_keyposes
from lerobot_env_bimanual.verification.episodes import recorded_actions, replay_env
from lerobot_env_bimanual.verification.result_files import ResultFile

OUTLIER_CM = 4
MIN_MOTION_CM = 1


def main() -> None:
    """Print a row per result."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--results", type=Path, required=True, help="file or folder, as for `results diagnose`"
    )
    parser.add_argument("--policy", help="of one policy only; by default of all")
    options = parser.parse_args()
    results = [ResultFile.read(path) for path in result_paths(options.results)]
    rows = [row(result) for result in results if options.policy in (None, result.policy_id)]
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.2f"))


def row(result: ResultFile) -> dict[str, str | int | float]:
    """Mean errors of a result in cm, and their correlation along world x, y and z."""
    result.check_world()
    errors = np.reshape([*errors_cm(result)], (-1, 2, 3))
    first, second = (pd.DataFrame(errors[:, keypose], columns=[*"xyz"]) for keypose in range(2))
    first_cm, second_cm = (np.linalg.norm(each, axis=1).mean() for each in (first, second))
    counts = {"result": result.name, "hands": len(errors), "first_cm": first_cm, "second_cm": second_cm}
    return counts | first.corrwith(second).to_dict()


def errors_cm(result: ResultFile) -> Iterator[NDArray[np.float64]]:
    """Of each hand in each episode, how far off (2, 3) the first and the second keypose are, world frame."""
    env = replay_env(result.record.task, result.record.options)
    for episode in tqdm(result.record.episodes, desc=result.name, unit="episode"):
        keyposes = [action for action in recorded_actions(episode) if action.size == KEYPOSE_DIM][:2]
        env.reset(seed=episode.seed, options={"variation": episode.variation})
        expert = rehearsed_keyposes(env)[:2]
        if len(keyposes) < 2 or len(expert) < 2:
            continue
        shape = (2, len(ARMS), ARM_KEYPOSE_DIM)
        reached_cm, true_cm = (
            100 * np.reshape(each, shape)[..., :3].astype(float) for each in (keyposes, expert)
        )
        off_cm, moves_cm = reached_cm - true_cm, np.linalg.norm(true_cm[1] - true_cm[0], axis=-1)
        meant = (np.linalg.norm(off_cm, axis=-1) < OUTLIER_CM).all(axis=0) & (moves_cm > MIN_MOTION_CM)
        yield from np.moveaxis(off_cm, 1, 0)[meant]
    env.close()


if __name__ == "__main__":
    main()
