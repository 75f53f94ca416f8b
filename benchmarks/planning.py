"""How long it takes to plan random keyposes, and straight lines of both hands.

python benchmarks/planning.py --problems=200
"""

import argparse
from collections import defaultdict
from collections.abc import Callable

import numpy as np
from harness import Figures, cpu_s, report

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import KeyposeFailure
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.motion.planner import KeyposePlanner
from lerobot_env_bimanual.world.scene import Scene

HANDS = {
    Arm.LEFT: Workspace((0.0, -0.1, 0.85), (0.4, 0.4, 1.25)),
    Arm.RIGHT: Workspace((0.1, -0.45, 0.85), (0.5, 0.1, 1.25)),
}
"""Where random hand positions are drawn: each on its own side, with a common strip in which the arms meet."""
LINE_M = 0.4


def random_pose(arm: Arm, rng: np.random.Generator) -> Pose:
    """A hand that points down or towards the other side, tilted by up to 45 degrees."""
    side = -1.0 if arm is Arm.LEFT else 1.0
    approach = np.array([(0.0, 0.0, -1.0), (0.0, side, 0.0)][rng.integers(2)]) + rng.uniform(-0.5, 0.5, 3)
    return Pose.looking(HANDS[arm].sample(rng), approach, rng.normal(size=3))


def shifted(pose: Pose, rng: np.random.Generator) -> Pose:
    """The same orientation, `LINE_M` away in a random direction."""
    direction = rng.normal(size=3)
    return pose.translated(LINE_M * direction / np.linalg.norm(direction))


def measure_plans(problems: int, times: defaultdict[str, list[float]]) -> None:
    """Plan random keyposes, execute those that have a plan, and plan straight lines from there; append milliseconds."""
    rng = np.random.default_rng(1)
    scene = Scene()
    planner = KeyposePlanner(scene)
    for _ in range(problems):
        poses = {arm: random_pose(arm, rng) for arm in ARMS}
        free = BimanualKeypose(
            *(Keypose(poses[arm], gripper_open=True, ignore_collisions=False) for arm in ARMS)
        )
        plan = timed(lambda free=free: planner.plan(free, rng), times["a keypose, free motion"])
        for action in plan.actions if plan else ():
            scene.tick(action)
        if plan:
            lines = [
                Keypose(shifted(poses[arm], rng), gripper_open=True, ignore_collisions=True) for arm in ARMS
            ]
            straight = BimanualKeypose(*lines)
            timed(
                lambda straight=straight: planner.plan(straight, rng), times[f"straight lines of {LINE_M} m"]
            )


def timed[T](work: Callable[[], T], times: list[float]) -> T | None:
    """What `work` returns, None where a keypose is refused; appends its CPU milliseconds."""
    results: list[T] = []

    def attempt() -> None:
        try:
            results.append(work())
        except KeyposeFailure:
            return

    times.append(1e3 * cpu_s(attempt))
    return results[0] if results else None


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    arguments.add_argument("--problems", type=int, default=200)
    options = arguments.parse_args()
    times: defaultdict[str, list[float]] = defaultdict(list)
    measure_plans(options.problems, times)
    rows: dict[str, Figures] = {
        kind: {
            "problems": len(each),
            "median ms": float(np.median(each)),
            "99 % ms": float(np.percentile(each, 99)),
        }
        for kind, each in times.items()
    }
    report("planning, CPU time", rows)


if __name__ == "__main__":
    main()
