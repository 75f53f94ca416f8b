"""What the simulated world costs on one core: control ticks and resets, observations, and plans.

python benchmarks/world.py simulation --task=all
python benchmarks/world.py observation --task=all
python benchmarks/world.py observation --perturb=light:2,camera_moved:2
python benchmarks/world.py planning --problems=200
"""

import argparse
import contextlib
import statistics
import time
from collections import defaultdict
from typing import Any
from unittest import mock

import numpy as np
from harness import Figures, cpu_s, interleaved_cpu_s, parser, report, tasks_of

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.motion.planner import KeyposeFailure, KeyposePlanner, Plan
from lerobot_env_bimanual.world.scene import Scene

SEED = 0
HANDS = {
    Arm.LEFT: Workspace((0.0, -0.1, 0.85), (0.4, 0.4, 1.25)),
    Arm.RIGHT: Workspace((0.1, -0.45, 0.85), (0.5, 0.1, 1.25)),
}
"""Where random hand positions are drawn: each on its own side, with a common strip in which the arms meet."""
LINE_M = 0.4


def simulation(options: argparse.Namespace) -> dict[str, Figures]:
    """How fast the simulation runs: control ticks at rest and in experts' episodes, and resets."""
    return {task: _ticks_and_resets(task, options) for task in tasks_of(options)}


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
    for task in tasks_of(options):
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
            least.append(interleaved_cpu_s([env.observe for env in envs], options.rounds))
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


def planning(options: argparse.Namespace) -> dict[str, Figures]:
    """How long it takes to plan random keyposes, and from where they lead, straight lines of both hands."""
    rng, scene = np.random.default_rng(1), Scene()
    planner = KeyposePlanner(scene)
    times: defaultdict[str, list[float]] = defaultdict(list)

    def plan(kind: str, poses: dict[Arm, Pose], ignore_collisions: bool) -> Plan | None:
        """The plan, None where the keypose is refused; notes its CPU milliseconds."""
        keyposes = (
            Keypose(poses[arm], gripper_open=True, ignore_collisions=ignore_collisions) for arm in ARMS
        )
        keypose, start, found = BimanualKeypose(*keyposes), time.process_time(), None
        with contextlib.suppress(KeyposeFailure):
            found = planner.plan(keypose, rng)
        times[kind].append(1e3 * (time.process_time() - start))
        return found

    for _ in range(options.problems):
        poses = {arm: _random_pose(arm, rng) for arm in ARMS}
        found = plan("a keypose, free motion", poses, ignore_collisions=False)
        for action in found.actions if found else ():
            scene.tick(action)
        if found:
            further = {arm: _shifted(pose, rng) for arm, pose in poses.items()}
            plan(f"straight lines of {LINE_M} m", further, ignore_collisions=True)
    return {
        kind: {
            "problems": len(each),
            "median ms": float(np.median(each)),
            "99 % ms": float(np.percentile(each, 99)),
        }
        for kind, each in times.items()
    }


def _random_pose(arm: Arm, rng: np.random.Generator) -> Pose:
    """A hand that points down or towards the other side, tilted by up to 45 degrees."""
    side = -1.0 if arm is Arm.LEFT else 1.0
    approach = np.array([(0.0, 0.0, -1.0), (0.0, side, 0.0)][rng.integers(2)]) + rng.uniform(-0.5, 0.5, 3)
    return Pose.looking(HANDS[arm].sample(rng), approach, rng.normal(size=3))


def _shifted(pose: Pose, rng: np.random.Generator) -> Pose:
    """The same orientation, `LINE_M` away in a random direction."""
    direction = rng.normal(size=3)
    return pose.translated(LINE_M * direction / np.linalg.norm(direction))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("what", choices=("simulation", "observation", "planning"))
    arguments.add_argument("--resets", type=int, default=10)
    arguments.add_argument("--perturb", default="", help="perturbations AXIS:LEVEL, one at a time")
    arguments.add_argument("--image_size", type=int, default=256)
    arguments.add_argument("--moments", type=int, default=10, help="of the episode")
    arguments.add_argument("--problems", type=int, default=200, help="keyposes to plan")
    options = arguments.parse_args()
    report(f"{options.what}, CPU time", globals()[options.what](options))


if __name__ == "__main__":
    main()
