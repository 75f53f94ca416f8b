"""What five RGB-D images of 256 pixels cost here and in another tree, in turns on the same machine.

Of each task the scene at the start and at the end of an expert's episode is rendered. Times are CPU times of the
rendering process, the least of many. Prints a Markdown table and, as the last line, the same figures as JSON.

    python benchmarks/observation.py --before=/path/to/another/tree
    python benchmarks/observation.py --tasks=lift_ball,push_box --rounds=5
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parents[1]
SIZE = 256
SEED = 0
IMAGES_PER_ROUND = 3


def serve() -> None:
    """Ready the task that a line names; then answer every "again" with the seconds of both scenes, until "next"."""
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.expert.runner import run_expert
    from lerobot_env_bimanual.world.rendering import Renderer

    for line in sys.stdin:
        env = BimanualEnv(line.strip(), split="val", obs="state", control_mode="keypose")
        env.reset(seed=SEED)
        states = [env.scene.save_state()]
        run_expert(env, SEED)
        states.append(env.scene.save_state())
        with Renderer(env.scene, height=SIZE, width=SIZE) as renderer:
            renderer.render()
            while sys.stdin.readline() == "again\n":
                print(*(_least_s(env.scene, renderer, state) for state in states), flush=True)
        env.close()


def _least_s(scene, renderer, state) -> float:
    scene.restore_state(state)
    times = []
    for _ in range(IMAGES_PER_ROUND):
        start = time.process_time()
        renderer.render()
        times.append(time.process_time() - start)
    return min(times)


def start_child(tree: Path) -> subprocess.Popen:
    """A process that renders with the packages of a tree, on one core."""
    paths = os.pathsep.join([str(tree), str(tree / "envs")])
    return subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        env={**os.environ, "PYTHONPATH": paths, "LP_NUM_THREADS": "1"},
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
    """A child's seconds per observation, of both scenes."""
    tell(child, "again")
    assert child.stdout is not None
    return [float(number) for number in child.stdout.readline().split()]


def measure(children: list[subprocess.Popen], task: str, rounds: int) -> list[float]:
    """Each child's milliseconds per observation of a task, the mean of both scenes."""
    for child in children:
        tell(child, task)
    answers = [[seconds(child) for child in children] for _ in range(rounds)]
    for child in children:
        tell(child, "next")
    least = [
        [min(scene) for scene in zip(*(answer[side] for answer in answers), strict=True)] for side in range(2)
    ]
    return [1e3 * sum(scenes) / len(scenes) for scenes in least]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path, default=HERE, help="another tree; without it, this one twice")
    parser.add_argument("--tasks", default="", help="names, comma separated; without it all")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return

    from lerobot_env_bimanual.tasks.registry import list_tasks

    children = [start_child(tree) for tree in (options.before.resolve(), HERE)]
    figures = {}
    print("| task | before, ms | after, ms | after / before |\n|---|---:|---:|---:|")
    for task in options.tasks.split(",") if options.tasks else list_tasks():
        before, after = measure(children, task, options.rounds)
        figures[task] = {"before_ms": before, "after_ms": after}
        print(f"| `{task}` | {before:.1f} | {after:.1f} | {after / before:.2f} |", flush=True)
    for child in children:
        child.communicate()
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
