"""How fast the simulated world is on this machine.

Prints a table and, as the last line, the same figures as JSON. All times are CPU times of this process, so that
other work on the machine changes them little; compare figures of one run with each other rather than runs.

    python benchmarks/simulation.py --task=lift_ball
    python benchmarks/simulation.py --task=all --episodes=3
    python benchmarks/simulation.py --task=all --before=/path/to/another/tree
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from rich.console import Console
from rich.table import Table
from two_trees import Figures, compare, serve

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import run_expert
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.tasks.registry import list_tasks, resolve_tasks
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import SLEEP, Scene

STEPS_PER_TICK = round(1 / (CONTROL_HZ * PHYSICS_STEP_S))

ROWS = {
    "steps_at_rest": ("physics steps per CPU second, hands at rest", "{:,.0f}"),
    "steps_in_episode": ("the same, all of an expert's episode", "{:,.0f}"),
    "tick_python_overhead": ("Python overhead of a joint tick", "{:.1%}"),
    "observation_ms": ("five RGB-D images", "{:.1f} ms"),
    "observation_per_tick": ("the same, in joint ticks", "{:.1f}"),
    "reset_ms": ("reset with rehearsals and settling, median", "{:.0f} ms"),
    "settle_ms": ("settling alone", "{:.1f} ms"),
    "state_hash_ms": ("state hash", "{:.3f} ms"),
    "build_ms": ("building the model", "{:.1f} ms"),
    "expert_s": ("expert's episode without images", "{:.2f} s"),
}


def cpu_seconds(work: Callable[[], object], repeats: int) -> float:
    """Median CPU time of one call."""
    work()
    return statistics.median(_times(work, repeats))


def interleaved_cpu_seconds(
    first: Callable[[], object], second: Callable[[], object], repeats: int
) -> list[float]:
    """Least CPU time of one call of each, measured in turns so that both see the same machine."""
    times = [(_times(first, 1)[0], _times(second, 1)[0]) for _ in range(repeats)]
    return [min(column) for column in zip(*times, strict=True)]


def _times(work: Callable[[], object], repeats: int) -> list[float]:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return times


def bare_tick(scene: Scene) -> None:
    """The physics of `Scene.tick` and nothing else."""
    model, data = scene.model, scene.data
    model.opt.enableflags |= SLEEP
    mujoco.mj_step2(model, data)
    mujoco.mj_step(model, data, STEPS_PER_TICK - 1)
    mujoco.mj_step1(model, data)
    model.opt.enableflags &= ~SLEEP


def measure_episodes(env: BimanualEnv, seeds: range) -> tuple[float, float]:
    """CPU seconds of physics per tick and of an episode, on average over the expert's episodes."""
    scene, seconds = env.scene, []
    tick = scene.tick

    def timed_tick(*args: Any) -> None:
        start = time.process_time()
        tick(*args)
        seconds.append(time.process_time() - start)

    start = time.process_time()
    with mock.patch.object(scene, "tick", timed_tick):
        for seed in seeds:
            run_expert(env, seed)
    total = time.process_time() - start
    return statistics.mean(seconds), total / len(seeds)


def ready(task: str) -> Callable[[], Figures]:
    """Measures physics steps per CPU second, at rest and in two episodes of the expert."""
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    run_expert(env, 0)

    def steps_per_s() -> Figures:
        env.reset(seed=0)
        hold = env.scene.commanded
        rest_s = cpu_seconds(lambda: env.scene.tick(hold), 100)
        episode_s, _ = measure_episodes(env, range(2))
        return [STEPS_PER_TICK / rest_s, STEPS_PER_TICK / episode_s]

    return steps_per_s


def print_ratios(before: Path, tasks: Sequence[str], rounds: int) -> None:
    """Steps per CPU second beside those of another tree."""
    figures = {}
    print("| task | at rest: before | now | now / before | in an episode: before | now | now / before |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for task, old, new in compare(__file__, before, tasks, rounds):
        cells = [f"{a:,.0f} | {b:,.0f} | {b / a:.2f}" for a, b in zip(old, new, strict=True)]
        print(f"| `{task}` | {' | '.join(cells)} |", flush=True)
        figures[task] = {"before": old, "now": new}
    print(json.dumps(figures))


def measure(task: str, image_size: int, repeats: int, episodes: int) -> dict[str, float | str]:
    env = BimanualEnv(task, split="val", obs="state")
    props = env.task_definition.spec.props
    build_s = cpu_seconds(lambda: Scene(props), 3)
    scene = env.scene
    seeds = iter(range(10**6))
    reset_s = cpu_seconds(lambda: env.reset(seed=next(seeds)), 2 * repeats)
    hold = scene.commanded
    tick_s, physics_s = interleaved_cpu_seconds(
        lambda: scene.tick(hold), lambda: bare_tick(scene), 20 * repeats
    )
    hash_s = cpu_seconds(scene.state_hash, 10 * repeats)
    with Renderer(scene, height=image_size, width=image_size) as renderer:
        observation_s = cpu_seconds(renderer.render, repeats)
    settle_s = cpu_seconds(scene.settle, repeats)
    episode_tick_s, episode_s = measure_episodes(env, range(episodes))
    env.close()
    return {
        "task": task,
        "mujoco": mujoco.__version__,
        "image_size": image_size,
        "steps_at_rest": STEPS_PER_TICK / physics_s,
        "steps_in_episode": STEPS_PER_TICK / episode_tick_s,
        "tick_python_overhead": tick_s / physics_s - 1,
        "observation_ms": 1e3 * observation_s,
        "observation_per_tick": observation_s / tick_s,
        "reset_ms": 1e3 * reset_s,
        "settle_ms": 1e3 * settle_s,
        "state_hash_ms": 1e3 * hash_s,
        "build_ms": 1e3 * build_s,
        "expert_s": episode_s,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="How fast the simulated world is on this machine.")
    parser.add_argument("--task", default="lift_ball", help=f"all, or of: {', '.join(list_tasks())}")
    parser.add_argument("--image_size", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--episodes", type=int, default=2, help="of the expert")
    parser.add_argument("--before", type=Path, help="compare steps per second with another tree")
    parser.add_argument("--rounds", type=int, default=5, help="turns of both trees")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(ready)
        return
    if args.before is not None:
        print_ratios(args.before, resolve_tasks(args.task), args.rounds)
        return
    figures = [
        measure(task, args.image_size, args.repeats, args.episodes) for task in resolve_tasks(args.task)
    ]
    if len(figures) == 1:
        table = Table("figure", "value", title=f"Simulation, CPU time, {figures[0]['task']}")
        for name, (label, form) in ROWS.items():
            table.add_row(label, form.format(figures[0][name]))
    else:
        shown = ("steps_at_rest", "steps_in_episode", "reset_ms", "observation_ms", "expert_s")
        table = Table("task", *shown, title="Simulation, CPU time")
        for row in figures:
            table.add_row(str(row["task"]), *(ROWS[name][1].format(row[name]) for name in shown))
    Console().print(table)
    print(json.dumps(figures[0] if len(figures) == 1 else figures))


if __name__ == "__main__":
    main()
