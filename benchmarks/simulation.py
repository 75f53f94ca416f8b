"""How fast the simulated world is on this machine.

Prints a table and, as the last line, the same figures as JSON. All times are CPU times of this process, so that
other work on the machine changes them little; compare figures of one run with each other rather than runs.

    python benchmarks/simulation.py --task=lift_ball
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable

from rich.console import Console
from rich.table import Table

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.registry import get_task, list_tasks
from lerobot_env_bimanual.rendering import Renderer
from lerobot_env_bimanual.scene import STEPS_PER_TICK, Scene


def cpu_seconds(work: Callable[[], object], repeats: int) -> float:
    """Median CPU time of one call."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def interleaved_cpu_seconds(
    first: Callable[[], object], second: Callable[[], object], repeats: int
) -> list[float]:
    """Least CPU time of one call of each, measured in turns so that both see the same machine."""
    least = [float("inf"), float("inf")]
    for _ in range(repeats):
        for index, work in enumerate((first, second)):
            start = time.process_time()
            work()
            least[index] = min(least[index], time.process_time() - start)
    return least


def measure(task: str, image_size: int, repeats: int) -> dict[str, float | str]:
    props = get_task(task).spec.props
    build_s = cpu_seconds(lambda: Scene(props), 5)
    scene = Scene(props)
    scene.settle()
    hold = scene.commanded

    def tick() -> None:
        scene.tick(hold)

    def physics() -> None:
        mujoco.mj_step(scene.model, scene.data, STEPS_PER_TICK)

    tick_s, physics_s = interleaved_cpu_seconds(tick, physics, 20 * repeats)
    with Renderer(scene, height=image_size, width=image_size) as renderer:
        observation_s = cpu_seconds(renderer.render, repeats)
    reset_s = cpu_seconds(lambda: (scene.reset(), scene.settle()), repeats)
    hash_s = cpu_seconds(scene.state_hash, 10 * repeats)
    return {
        "task": task,
        "mujoco": mujoco.__version__,
        "image_size": image_size,
        "physics_steps_per_cpu_second": STEPS_PER_TICK / physics_s,
        "tick_python_overhead": tick_s / physics_s - 1,
        "observation_ms": 1e3 * observation_s,
        "observation_per_tick": observation_s / tick_s,
        "reset_ms": 1e3 * reset_s,
        "state_hash_ms": 1e3 * hash_s,
        "build_ms": 1e3 * build_s,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="How fast the simulated world is on this machine.")
    parser.add_argument("--task", default="lift_ball", choices=list_tasks())
    parser.add_argument("--image_size", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=10)
    args = parser.parse_args()
    figures = measure(args.task, args.image_size, args.repeats)

    table = Table("figure", "value", title=f"Simulation, CPU time, task {args.task}")
    table.add_row("physics steps per CPU second", f"{figures['physics_steps_per_cpu_second']:,.0f}")
    table.add_row("Python overhead of a joint tick", f"{figures['tick_python_overhead']:.1%} of its physics")
    table.add_row(f"five RGB-D images of {args.image_size} px", f"{figures['observation_ms']:.1f} ms")
    table.add_row("the same, in joint ticks", f"{figures['observation_per_tick']:.1f}")
    table.add_row("reset with settling", f"{figures['reset_ms']:.1f} ms")
    table.add_row("state hash", f"{figures['state_hash_ms']:.3f} ms")
    table.add_row("building the model", f"{figures['build_ms']:.1f} ms")
    Console().print(table)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
