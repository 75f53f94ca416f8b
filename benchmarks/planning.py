"""How long it takes to plan random keyposes, and straight lines of both hands.

python benchmarks/planning.py --problems=200
"""

import argparse
import contextlib
import time
from collections import defaultdict

import numpy as np
from harness import Figures, report

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import KeyposeFailure
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.motion.planner import KeyposePlanner, Plan
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


def measure(problems: int) -> dict[str, Figures]:
    """Plan random keyposes, execute those that have a plan, and plan straight lines from there."""
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

    for _ in range(problems):
        poses = {arm: random_pose(arm, rng) for arm in ARMS}
        found = plan("a keypose, free motion", poses, ignore_collisions=False)
        for action in found.actions if found else ():
            scene.tick(action)
        if found:
            further = {arm: shifted(pose, rng) for arm, pose in poses.items()}
            plan(f"straight lines of {LINE_M} m", further, ignore_collisions=True)
    return {
        kind: {
            "problems": len(each),
            "median ms": float(np.median(each)),
            "99 % ms": float(np.percentile(each, 99)),
        }
        for kind, each in times.items()
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    arguments.add_argument("--problems", type=int, default=200)
    report("planning, CPU time", measure(arguments.parse_args().problems))


if __name__ == "__main__":
    main()
