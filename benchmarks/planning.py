"""How fast keyposes are planned on this machine.

Prints tables and, as the last line, the same figures as JSON. The second table is what a reset takes: draws, rehearsals
and settling, as evaluations and certificates pay it; with `--before`, beside that of another tree. All times are CPU times of this process, so that
other work on the machine changes them little.

    python benchmarks/planning.py --problems=200
    python benchmarks/planning.py --problems=0 --before=/path/to/another/tree
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from two_trees import HERE, Figures, compare, serve

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import KeyposeFailure
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.motion.feasibility import goal_postures
from lerobot_env_bimanual.motion.lines import LineRequest, straight_lines
from lerobot_env_bimanual.motion.planner import KeyposePlanner
from lerobot_env_bimanual.robots.kinematics import ArmKinematics
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene

HANDS = {
    Arm.LEFT: Workspace((0.0, -0.1, 0.85), (0.4, 0.4, 1.25)),
    Arm.RIGHT: Workspace((0.1, -0.45, 0.85), (0.5, 0.1, 1.25)),
}
"""Where random hand poses lie: each on its own side, with a common strip in which the arms meet."""
LINE_M = 0.4
RESET_GOAL_MS = {"straighten_rope": 60}
"""Medians; of all other tasks `USUAL_RESET_GOAL_MS`."""
USUAL_RESET_GOAL_MS = 40
RESETS_PER_ROUND = 10


class Stopwatch:
    """CPU times of one kind of problem, and how many of them had a solution."""

    def __init__(self):
        self.milliseconds: list[float] = []
        self.solved = 0

    def time[**P, T](self, work: Callable[P, T | None], *args: P.args, **kwargs: P.kwargs) -> T | None:
        """Call something that returns None, or refuses, where there is no solution."""
        start = time.process_time()
        try:
            result = work(*args, **kwargs)
        except KeyposeFailure:
            result = None
        self.milliseconds.append(1e3 * (time.process_time() - start))
        self.solved += result is not None
        return result

    def add(self, other: "Stopwatch") -> None:
        self.milliseconds += other.milliseconds
        self.solved += other.solved

    def figures(self) -> dict[str, float]:
        median, p99 = np.percentile(self.milliseconds, [50, 99])
        return {
            "problems": len(self.milliseconds),
            "solved": self.solved,
            "median_ms": round(float(median), 2),
            "p99_ms": round(float(p99), 2),
        }


def random_hand(arm: Arm, rng: np.random.Generator) -> Pose:
    """A hand that points down or towards the other side, tilted by up to 45 degrees."""
    side = -1.0 if arm is Arm.LEFT else 1.0
    approach = np.array([(0.0, 0.0, -1.0), (0.0, side, 0.0)][rng.integers(2)]) + rng.uniform(-0.5, 0.5, 3)
    return Pose.looking(HANDS[arm].sample(rng), approach, rng.normal(size=3))


def random_keypose(
    rng: np.random.Generator, straight: bool, start: BimanualKeypose | None = None
) -> BimanualKeypose:
    """Random targets; with `start`, straight lines of 40 cm that keep the hands' directions."""
    targets = []
    for arm in ARMS:
        if start is None:
            pose = random_hand(arm, rng)
        else:
            way = rng.normal(size=3)
            pose = start[arm].pose.translated(LINE_M * way / np.linalg.norm(way))
        targets.append(Keypose(pose, gripper_open=True, ignore_collisions=straight))
    return BimanualKeypose(*targets)


def best_posture(kinematics: ArmKinematics, start: np.ndarray, pose: Pose) -> np.ndarray | None:
    """The posture in which a free motion would end."""
    return next(iter(goal_postures(kinematics, start, pose.matrix)), None)


def rehearse_both(rehearsal: Rehearsal, task: Task, variation: Variation) -> bool | None:
    """The check of a placement: the script with exact and with rounded keyposes."""
    reason = rehearsal.infeasibility(lambda view: task.script(view, variation))
    return True if reason is None else None


def measure_kinematics(problems: int, watches: dict[str, Stopwatch]) -> None:
    rng = np.random.default_rng(0)
    scene = Scene()
    arms = {arm: scene.arm_pair.kinematics[arm] for arm in ARMS}
    for index in range(problems):
        arm = ARMS[index % 2]
        pose = random_hand(arm, rng)
        posture = watches["goal postures of a pose"].time(
            best_posture, arms[arm], scene.arm_pair.home_joints, pose
        )
        way = rng.normal(size=3)
        target = pose.translated(LINE_M * way / np.linalg.norm(way)).matrix
        if posture is not None and len(arms[arm].ik(target)):
            watches["line of 0.4 m"].time(straight_lines, [LineRequest(arms[arm], posture, target)])


def measure_plans(problems: int, watches: dict[str, Stopwatch]) -> None:
    rng = np.random.default_rng(1)
    scene = Scene()
    planner = KeyposePlanner(scene)
    for _ in range(problems):
        keypose = random_keypose(rng, straight=False)
        watch = Stopwatch()
        plan = watch.time(planner.plan, keypose, rng)
        if plan is None:  # mostly out of reach, or hands that would meet
            kind = "keypose, refused"
        else:
            kind = "keypose, free, around the other arm" if plan.used_rrt else "keypose, free"
        watches[kind].add(watch)
        if plan is None:
            continue
        for action in plan.actions:
            scene.tick(action)
        straight = random_keypose(rng, straight=True, start=keypose)
        watches["keypose, straight 0.4 m"].time(planner.plan, straight, rng)


def measure_rehearsals(draws: int, watches: dict[str, Stopwatch]) -> None:
    for name in list_tasks():
        task = get_task(name)
        scene = Scene(task.spec.props)
        rehearsal = Rehearsal(scene, codecs=(None, KeyposeCodec()))
        rng = np.random.default_rng(2)
        for draw in range(draws):
            scene.reset()
            variation = task.spec.variations[draw % len(task.spec.variations)]
            if task.place(scene, variation, rng):
                watches["rehearsal of a placement"].time(rehearse_both, rehearsal, task, variation)


def ready(task: str) -> Callable[[], Figures]:
    """Measures the median CPU milliseconds of a reset, as `lerobot-eval` and certificates pay it."""
    env = BimanualEnv(task, split="val", obs="state")
    env.reset(seed=RESETS_PER_ROUND)
    watch = Stopwatch()

    def median_ms() -> Figures:
        for seed in range(RESETS_PER_ROUND):
            watch.time(env.reset, seed=seed)
        return [statistics.median(watch.milliseconds[-RESETS_PER_ROUND:])]

    return median_ms


def measure_resets(before: Path, rounds: int) -> dict[str, dict[str, float]]:
    """Median reset of every task, beside another tree's; prints a row per task."""
    figures = {}
    print("| task | reset before, ms | now, ms | now / before | goal, ms |\n|---|---:|---:|---:|---:|")
    for task, (old,), (new,) in compare(__file__, before, list_tasks(), rounds):
        goal = RESET_GOAL_MS.get(task, USUAL_RESET_GOAL_MS)
        print(f"| `{task}` | {old:.1f} | {new:.1f} | {new / old:.2f} | {goal} |", flush=True)
        figures[task] = {"before_ms": old, "now_ms": new, "goal_ms": goal}
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--draws", type=int, default=10, help="placements rehearsed per task")
    parser.add_argument("--before", type=Path, default=HERE, help="another tree; without it, this one twice")
    parser.add_argument("--rounds", type=int, default=3, help="turns of both trees")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(ready)
        return
    kinds = (
        "goal postures of a pose",
        "line of 0.4 m",
        "keypose, free",
        "keypose, free, around the other arm",
        "keypose, straight 0.4 m",
        "keypose, refused",
        "rehearsal of a placement",
    )
    watches = {kind: Stopwatch() for kind in kinds}
    measure_kinematics(args.problems, watches)
    measure_plans(args.problems, watches)
    measure_rehearsals(args.draws, watches)

    table = Table("kind", "problems", "solved", "median", "99 %", title="Planning, CPU time in ms")
    figures = {kind: watch.figures() for kind, watch in watches.items() if watch.milliseconds}
    for kind, row in figures.items():
        table.add_row(
            kind, str(row["problems"]), str(row["solved"]), f"{row['median_ms']:.1f}", f"{row['p99_ms']:.1f}"
        )
    Console().print(table)
    resets = measure_resets(args.before, args.rounds)
    print(json.dumps(figures | {"resets": resets}))


if __name__ == "__main__":
    main()
