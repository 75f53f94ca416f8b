"""How many observations of five RGB-D images of 256 pixels a second of one core makes, here and in another tree.

Of each task ten moments of two experts' episodes are rendered in their order, in turns with the other tree, so the
first observation of an episode counts for a tenth. Times are CPU times of the rendering process with all its threads, of each
moment the least of all rounds. Prints a Markdown table and, as the last line, the same figures as JSON.

    python benchmarks/observation.py --before=/path/to/another/tree
    python benchmarks/observation.py --tasks=lift_ball,push_box --moments=60 --rounds=3   # more like a recording
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parents[1]
SIZE = 256
SEEDS = (0, 1)


def serve(count: int) -> None:
    """Ready the task that a line names; then answer every "again" with the seconds of all moments, until "next"."""
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import run_expert
    from lerobot_env_bimanual.world.rendering import Renderer

    for line in sys.stdin:
        env = BimanualEnv(line.strip(), split="val", obs="state", control_mode="keypose")
        moments = []
        for seed in SEEDS:
            states = []
            env.tick_observers = [lambda env, _, states=states: states.append(env.scene.save_state())]
            run_expert(env, seed)
            moments += [states[number * len(states) // count] for number in range(count)]
        with Renderer(env.scene, height=SIZE, width=SIZE) as renderer:
            while sys.stdin.readline() == "again\n":
                print(*(_seconds(env.scene, renderer, state) for state in moments), flush=True)
        env.close()


def _seconds(scene, renderer, state) -> float:
    scene.restore_state(state)
    start = time.process_time()
    renderer.render()
    return time.process_time() - start


def start_child(tree: Path, moments: int) -> subprocess.Popen:
    """A process that renders with the packages of a tree."""
    paths = os.pathsep.join([str(tree), str(tree / "envs")])
    return subprocess.Popen(
        [sys.executable, __file__, "--serve", f"--moments={moments}"],
        env={**os.environ, "PYTHONPATH": paths},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def tell(child: subprocess.Popen, line: str) -> None:
    """Send a line to a child."""
    assert child.stdin is not None
    child.stdin.write(f"{line}\n")
    child.stdin.flush()


def seconds(child: subprocess.Popen) -> list[float]:
    """A child's seconds per observation, moment by moment."""
    tell(child, "again")
    assert child.stdout is not None
    return [float(number) for number in child.stdout.readline().split()]


def measure(children: list[subprocess.Popen], task: str, rounds: int) -> list[float]:
    """Each child's observations of a task per second."""
    for child in children:
        tell(child, task)
    answers = [[seconds(child) for child in children] for _ in range(rounds)]
    for child in children:
        tell(child, "next")
    least = [[min(times) for times in zip(*side, strict=True)] for side in zip(*answers, strict=True)]
    return [1 / statistics.mean(times) for times in least]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path, default=HERE, help="another tree; without it, this one twice")
    parser.add_argument("--tasks", default="", help="names, comma separated; without it all")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--moments", type=int, default=10, help="of an episode")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(options.moments)
        return

    from lerobot_env_bimanual.tasks.registry import list_tasks

    children = [start_child(tree, options.moments) for tree in (options.before.resolve(), HERE)]
    figures = {}
    print("| task | before, per s | after, per s | after / before |\n|---|---:|---:|---:|")
    for task in options.tasks.split(",") if options.tasks else list_tasks():
        before, after = measure(children, task, options.rounds)
        figures[task] = {"before_per_s": before, "after_per_s": after}
        print(f"| `{task}` | {before:.1f} | {after:.1f} | {after / before:.2f} |", flush=True)
    for name, pick in (("slowest", min), ("median", statistics.median)):
        before, after = (
            pick(rates[side] for rates in figures.values()) for side in ("before_per_s", "after_per_s")
        )
        print(f"| {name} | {before:.1f} | {after:.1f} | {after / before:.2f} |")
    for child in children:
        child.communicate()
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
