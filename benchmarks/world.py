"""What the simulated world costs on one core: control ticks and resets, and observations.

python benchmarks/world.py simulation --task=all
python benchmarks/world.py observation --task=all
python benchmarks/world.py observation --perturb=light:2,camera_moved:2

It prints a table for people, and as its last line the same figures as JSON.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from typing import Any
from unittest import mock

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # read when NumPy is loaded

import pandas as pd

from lerobot_bimanual.terminal import print_table
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.tasks.registry import resolve_tasks

SEED = 0

type Figures = dict[str, float]


def cpu_s(work: Callable[[], object], calls: int = 1) -> float:
    """CPU seconds of this process, with all its threads, per call."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def simulation(options: argparse.Namespace) -> dict[str, Figures]:
    """How fast the simulation runs: control ticks at rest and in experts' episodes, and resets."""
    return {task: _ticks_and_resets(task, options) for task in resolve_tasks(options.task)}


def _ticks_and_resets(task: str, options: argparse.Namespace) -> Figures:
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    scene = env.scene
    reset_s = [cpu_s(lambda seed=seed: env.reset(seed=seed)) for seed in range(options.resets)]
    episodes = [_episode_s(env, seed) for seed in range(options.rounds)]
    env.reset(seed=SEED)
    hold = scene.commanded
    rest_s = min(cpu_s(lambda: scene.tick(hold), 100) for _ in range(options.rounds))
    figures = {
        "ticks per s at rest": 1 / rest_s,
        "ticks per s in an episode": 1 / statistics.mean(tick_s for tick_s, _ in episodes),
        "expert's episode, s": statistics.mean(total_s for _, total_s in episodes),
        "reset, median ms": 1e3 * statistics.median(reset_s),
        "settling, ms": 1e3 * min(cpu_s(scene.settle) for _ in range(options.rounds)),
    }
    env.close()
    return figures


def _episode_s(env: BimanualEnv, seed: int) -> tuple[float, float]:
    """CPU seconds per control tick, without planning and checks, and of the whole episode of the expert."""
    seconds, tick = [], env.scene.tick

    def timed_tick(*args: Any) -> None:
        seconds.append(cpu_s(lambda: tick(*args)))

    with mock.patch.object(env.scene, "tick", timed_tick):
        total_s = cpu_s(lambda: run_episode(env, seed, expert()))
    return statistics.mean(seconds), total_s


def observation(options: argparse.Namespace) -> dict[str, Figures]:
    """How many observations of five RGB-D images are rendered per second, and what perturbations of images cost.

    The same moments of an expert's episode are rendered in turns in every environment; of each the fastest round counts.
    """
    chosen = {"nominal": ""} | {perturb: perturb for perturb in options.perturb.split(",") if perturb}
    rows: dict[str, Figures] = {}
    for task in resolve_tasks(options.task):
        size = str(options.image_size)
        envs = [BimanualEnv(task, split="val", image_size=size, perturb=each) for each in chosen.values()]
        for env in envs:
            env.reset(seed=SEED)
        least: list[list[float]] = []
        for state in _states_of(task, options.moments):
            for env in envs:
                appearance = env.scene.appearance
                env.scene.restore_state(state)
                env.scene.appearance = appearance  # of its own episode
            turns = [[cpu_s(env.observe) for env in envs] for _ in range(options.rounds)]
            least.append([min(times) for times in zip(*turns, strict=True)])
        for env in envs:
            env.close()
        means = [statistics.mean(times) for times in zip(*least, strict=True)]
        for name, mean_s in zip(chosen, means, strict=True):
            rows[f"{task}, {name}"] = {
                "observations per s": 1 / mean_s,
                "time, of nominal": mean_s / means[0],
            }
    return rows


def _states_of(task: str, moments: int) -> list[Any]:
    """States of an expert's episode at regular intervals."""
    states: list[Any] = []
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    with env.observed_by(lambda env, _: states.append(env.save_state()[0])):
        run_episode(env, SEED, expert())
    env.close()
    return [states[number * len(states) // moments] for number in range(moments)]


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    arguments.add_argument("what", choices=("simulation", "observation"))
    arguments.add_argument("--task", default="lift_ball", help="task and suite names, comma separated")
    arguments.add_argument("--rounds", type=int, default=5, help="repetitions; the fastest counts")
    arguments.add_argument("--resets", type=int, default=10)
    arguments.add_argument("--perturb", default="", help="perturbations AXIS:LEVEL, one at a time")
    arguments.add_argument("--image_size", type=int, default=256)
    arguments.add_argument("--moments", type=int, default=10, help="of the episode")
    options = arguments.parse_args()
    title, figures = f"{options.what}, CPU time", globals()[options.what](options)
    cells = pd.DataFrame(figures).T.map("{:.4g}".format)
    print_table(cells.rename_axis("").reset_index(), title)
    print(json.dumps({"benchmark": title, "figures": figures}))


if __name__ == "__main__":
    main()
