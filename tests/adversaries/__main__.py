"""Play the single-arm adversaries and print how many episodes each arm solves.

Usage, in the folder `tests`: python -m adversaries [--task=lift_tray] [--first_seed=61000] [--episodes=20]
"""

import argparse

from adversaries.joint import tally, ways_of
from adversaries.known import KNOWN
from adversaries.single_arm import TASKS, single_arm
from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import run_episode
from lerobot_env_bimanual.tasks.registry import resolve_tasks


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--task", default="")
    parser.add_argument("--first_seed", type=int, default=61000)
    parser.add_argument("--episodes", type=int, default=20)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.episodes)
    tasks = resolve_tasks(arguments.task or "all")
    for task, module, arm in KNOWN:
        if task in tasks:
            solved, but_for_the_way = tally(ways_of(module), task, Arm(arm), seeds)
            text = f"{task}: {arm} arm alone solves {len(solved)} of {len(seeds)}"
            print(f"{text}, and {len(but_for_the_way)} but for what happened on the way")  # noqa: T201
    for task in set(TASKS).intersection(tasks):
        env = BimanualEnv(task, split="test", obs="state")
        for arm in ARMS:
            solved = [seed for seed in seeds if run_episode(env, seed, single_arm(arm)).success]
            print(f"{task}: {arm.value} arm alone solves {len(solved)} of {len(seeds)}: {solved}")  # noqa: T201
        env.close()


if __name__ == "__main__":
    main()
