"""What five RGB-D images cost in two trees, in turns on the same machine.

Of each task the scene at the start and at the end of an expert's episode is rendered. Times are CPU times of the
rendering process, the least of many; the two trees are asked in turns, so that both see the same machine.

    python benchmarks/observation.py --before=/path/to/other/tree
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

SIZE = 256
SEED = 0


def serve() -> None:
    """Answer on the standard output: a task's name readies it, and a number asks for that many images of both scenes."""
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.expert.runner import run_expert
    from lerobot_env_bimanual.world.rendering import Renderer

    env, renderer, states = None, None, []
    for line in sys.stdin:
        word = line.strip()
        if not word.isdigit():
            if renderer is not None:
                renderer.close()
                env.close()
            env = BimanualEnv(word, split="val", obs="state", control_mode="keypose")
            states = []
            run_expert(
                env, SEED, on_move=lambda _, env=env, states=states: states.append(env.scene.save_state())
            )
            states = [states[0], env.scene.save_state()]
            renderer = Renderer(env.scene, height=SIZE, width=SIZE)
            renderer.render()
            print(0, 0, flush=True)
            continue
        least = []
        for state in states:
            env.scene.restore_state(state)
            times = []
            for _ in range(int(word)):
                start = time.process_time()
                renderer.render()
                times.append(time.process_time() - start)
            least.append(min(times))
        print(*least, flush=True)


def start_child(tree: Path) -> subprocess.Popen:
    """A process that renders with the packages of a tree."""
    paths = [str(tree), str(tree / "envs")]
    return subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "LP_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def ask(child: subprocess.Popen, word: object) -> list[float]:
    """One answer of a child."""
    child.stdin.write(f"{word}\n")
    child.stdin.flush()
    return [float(number) for number in child.stdout.readline().split()]


def main() -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path)
    parser.add_argument("--after", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--tasks", default="")
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return

    from lerobot_env_bimanual.tasks.registry import list_tasks

    children = [start_child(tree) for tree in (options.before, options.after)]
    print("| task | before, ms | after, ms | after / before |\n| --- | ---: | ---: | ---: |")
    for task in options.tasks.split(",") if options.tasks else list_tasks():
        for child in children:
            ask(child, task)
        rounds = [[ask(child, 3) for child in children] for _ in range(options.rounds)]
        before, after = (
            sum(min(answers[side][scene] for answers in rounds) for scene in range(2)) / 2
            for side in range(2)
        )
        print(f"| `{task}` | {1e3 * before:.1f} | {1e3 * after:.1f} | {after / before:.2f} |", flush=True)
    for child in children:
        child.stdin.close()
        child.wait()


if __name__ == "__main__":
    main()
