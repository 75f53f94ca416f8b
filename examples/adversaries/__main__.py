"""Play the single-arm adversaries and print how many episodes each arm solves.

Usage, in the folder `examples`: python -m adversaries [--task=push_box] [--first_seed=61000] [--episodes=20]
"""

import argparse

from adversaries.ways import SOLVED_BY_ONE_ARM, UNSOLVED_BY_ONE_ARM, tally
from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.tasks.registry import resolve_tasks


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--task", default="all")
    parser.add_argument("--first_seed", type=int, default=61000)
    parser.add_argument("--episodes", type=int, default=20)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.episodes)
    for task, arm in (*SOLVED_BY_ONE_ARM, *UNSOLVED_BY_ONE_ARM):
        if task in resolve_tasks(arguments.task):
            solved, solved_by_end_state = tally(task, Arm(arm), seeds)
            text = f"{task}: {arm} arm alone solves {len(solved)} of {len(seeds)}"
            print(f"{text}, {len(solved_by_end_state)} if what happened on the way did not count")


if __name__ == "__main__":
    main()
