"""How fast the simulation runs: control ticks at rest and in experts' episodes, and resets.

python benchmarks/simulation.py --task=all
"""

import statistics
from typing import Any
from unittest import mock

from harness import Figures, cpu_s, parser, report, tasks_of

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode


def measure(task: str, rounds: int, resets: int) -> Figures:
    """Figures of one task, in CPU time of one core."""
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    scene = env.scene
    reset_s = [cpu_s(lambda seed=seed: env.reset(seed=seed)) for seed in range(resets)]
    episodes = [measure_episode(env, seed) for seed in range(rounds)]
    env.reset(seed=0)
    hold = scene.commanded
    rest_s = min(cpu_s(lambda: scene.tick(hold), 100) for _ in range(rounds))
    figures = {
        "ticks per s at rest": 1 / rest_s,
        "ticks per s in an episode": 1 / statistics.mean(tick_s for tick_s, _ in episodes),
        "expert's episode, s": statistics.mean(total_s for _, total_s in episodes),
        "reset, median ms": 1e3 * statistics.median(reset_s),
        "settling, ms": 1e3 * min(cpu_s(scene.settle) for _ in range(rounds)),
    }
    env.close()
    return figures


def measure_episode(env: BimanualEnv, seed: int) -> tuple[float, float]:
    """CPU seconds per control tick, without planning and checks, and of the whole episode of the expert."""
    seconds, tick = [], env.scene.tick

    def timed_tick(*args: Any) -> None:
        seconds.append(cpu_s(lambda: tick(*args)))

    with mock.patch.object(env.scene, "tick", timed_tick):
        total_s = cpu_s(lambda: run_episode(env, seed, expert()))
    return statistics.mean(seconds), total_s


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--resets", type=int, default=10)
    options = arguments.parse_args()
    rows = {task: measure(task, options.rounds, options.resets) for task in tasks_of(options)}
    report("simulation, CPU time", rows)


if __name__ == "__main__":
    main()
