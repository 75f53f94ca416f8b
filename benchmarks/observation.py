"""How many observations of five RGB-D images a core renders per second, and what perturbations of images cost.

The same moments of an expert's episode are rendered in turns in every environment; of each moment the fastest round counts.

    python benchmarks/observation.py --task=all
    python benchmarks/observation.py --perturb=light:2,camera_moved:2
"""

import statistics
from typing import Any

from harness import Figures, interleaved_cpu_s, parser, report, tasks_of

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode

NOMINAL = "nominal"
SEED = 0


def states_of(task: str, moments: int) -> list[Any]:
    """States of an expert's episode at regular intervals."""
    states: list[Any] = []
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    with env.observed_by(lambda env, _: states.append(env.save_state()[0])):
        run_episode(env, SEED, expert())
    env.close()
    return [states[number * len(states) // moments] for number in range(moments)]


def put(env: BimanualEnv, state: Any) -> None:
    """Restore a state, with the appearance that this environment's episode has."""
    appearance = env.scene.appearance
    env.scene.restore_state(state)
    env.scene.appearance = appearance


def measure(task: str, perturbations: list[str], size: int, moments: int, rounds: int) -> dict[str, Figures]:
    """Figures of the nominal environment and of each perturbed one."""
    chosen = {NOMINAL: ""} | {perturb: perturb for perturb in perturbations}
    envs = [
        BimanualEnv(task, split="val", image_size=str(size), perturb=perturb) for perturb in chosen.values()
    ]
    for env in envs:
        env.reset(seed=SEED)
    least: list[list[float]] = []
    for state in states_of(task, moments):
        for env in envs:
            put(env, state)
        least.append(interleaved_cpu_s([env.observe for env in envs], rounds))
    for env in envs:
        env.close()
    means = [statistics.mean(times) for times in zip(*least, strict=True)]
    return {
        f"{task}, {name}": {"observations per s": 1 / mean_s, "time, of nominal": mean_s / means[0]}
        for name, mean_s in zip(chosen, means, strict=True)
    }


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--perturb", default="", help="perturbations AXIS:LEVEL, comma separated, one at a time"
    )
    arguments.add_argument("--image_size", type=int, default=256)
    arguments.add_argument("--moments", type=int, default=10, help="of the episode")
    options = arguments.parse_args()
    perturbations = [each for each in options.perturb.split(",") if each]
    rows: dict[str, Figures] = {}
    for task in tasks_of(options):
        rows |= measure(task, perturbations, options.image_size, options.moments, options.rounds)
    report(f"observations of five RGB-D images of {options.image_size} px, CPU time", rows)


if __name__ == "__main__":
    main()
