"""What each axis costs an observation of five RGB-D images of 256 pixels, beside the world as it is.

All axes that change what is seen are measured in turns in one process, moment by moment of the same episode; a second
world as it is stands among them and shows how far the figures can be trusted. Times are CPU times of the process with all
its threads; of each moment the least of all rounds. Prints a Markdown table and, as the last line, the figures as JSON.

    python benchmarks/perturbations.py
    python benchmarks/perturbations.py --task=put_item_in_drawer --levels=1,2,3 --moments=20
"""

import argparse
import json
import statistics
import time

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import run_expert
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes

SEED = 0


def worlds(task: str, levels: list[int]) -> dict[str, BimanualEnv]:
    """An environment for each rung; the first is the world as it is, and so is the second."""
    axes = [name for name in list_axes() if {"look", "see"} & set(get_axis(name).hooks)]
    rungs = {"level 0": "", "level 0 again": ""} | {f"{a}:{n}": f"{a}:{n}" for a in axes for n in levels}
    return {name: BimanualEnv(task, split="val", perturb=perturb) for name, perturb in rungs.items()}


def states_of(task: str, moments: int) -> list:
    """Of an expert's episode, evenly spread."""
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    states = []
    with env.observed_by(lambda env, _: states.append(env.save_state()[0])):
        run_expert(env, SEED)
    env.close()
    return [states[number * len(states) // moments] for number in range(moments)]


def seconds(env: BimanualEnv, state) -> float:
    """CPU time of an observation of a state that looks as this environment's episode does."""
    appearance = env.scene.appearance
    env.scene.restore_state(state)
    env.scene.appearance = appearance
    start = time.process_time()
    env.observe()
    return time.process_time() - start


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--task", default="handover_item_easy")
    parser.add_argument("--levels", default="1,3")
    parser.add_argument("--moments", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    envs = worlds(options.task, [int(level) for level in options.levels.split(",")])
    for env in envs.values():
        env.reset(seed=SEED)
        env.observe()
    least: dict[str, list[float]] = {name: [] for name in envs}
    for state in states_of(options.task, options.moments):
        rounds = [{name: seconds(env, state) for name, env in envs.items()} for _ in range(options.rounds)]
        for name, times in least.items():
            times.append(min(each[name] for each in rounds))
    plain, *_ = least.values()
    print("| rung | ms per observation | of level 0 |\n|---|---:|---:|")
    rows = {name: (statistics.mean(times), sum(times) / sum(plain)) for name, times in least.items()}
    for name, (mean_s, ratio) in rows.items():
        print(f"| `{name}` | {mean_s * 1e3:.1f} | {ratio:.2f} |")
    print(json.dumps({name: round(ratio, 3) for name, (_, ratio) in rows.items()}))


if __name__ == "__main__":
    main()
