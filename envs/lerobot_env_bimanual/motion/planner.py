"""Plans the joint actions that execute a keypose."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM, Arm
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.joint_action import ARM_ACTION_DIM, GRIPPER_FRAMES, JOINT_ACTION_DIM, by_arm
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.motion.carrying import props_in_hands
from lerobot_env_bimanual.motion.collision import CollisionChecker, CollisionRules
from lerobot_env_bimanual.motion.feasibility import free_goals, goal_postures, is_at_target
from lerobot_env_bimanual.motion.joint_path import JointPath, rounded
from lerobot_env_bimanual.motion.lines import LineRequest, straight_lines
from lerobot_env_bimanual.motion.rrt_connect import rrt_connect
from lerobot_env_bimanual.motion.time_law import CONTACT, FREE, PUSHING, Pace, is_beside_heavy, tick_fractions
from lerobot_env_bimanual.robots.kinematics import LIMIT_SAFETY_RAD
from lerobot_env_bimanual.world.scene import Scene

Array = NDArray[np.floating]

REST_TICKS = 2
"""Ticks of rest at the end of each motion, 0.1 s."""
PATH_CHECK_RAD = 0.02
"""Joint travel between two collision checks along a path."""
MAX_GOALS = 4
"""Combinations of goal postures that are tried."""
RRT_ITERATIONS = 1500
SWEPT_SHARES = np.linspace(0.0, 1.0, 5)
"""Shares of the other arm's own motion at which it is checked, when only one arm searches a way around obstacles."""


class KeyposeFailure(BimanualError):
    """A keypose that one arm cannot reach; ends the episode as a failure.

    Attributes:
        arm: name of the arm, or "both".
    """

    def __init__(self, arm: str, reason: str):
        self.arm = str(arm)
        super().__init__(f"{'both arms' if self.arm == 'both' else self.arm + ' arm'}: {reason}")


@dataclass(frozen=True, eq=False)
class Plan:
    """A keypose's motion, complete before it starts.

    Attributes:
        actions: (T, 16) float32 joint actions, one per control tick: motion, rest, and waiting for grippers.
        line_fallbacks: arms whose straight line was infeasible and was replaced by a joint-space motion.
    """

    actions: NDArray[np.float32]
    line_fallbacks: int


@dataclass(eq=False)
class _Motion:
    """Both arms' motion to a keypose while it is being planned."""

    start: dict[Arm, Array]
    paths: dict[Arm, JointPath] = field(default_factory=dict)
    paces: dict[Arm, Pace] = field(default_factory=dict)
    line_fallbacks: int = 0


class KeyposePlanner:
    """Plans keyposes from a scene's last joint action and the props' present positions.

    A plan is a function of the scene's state, the keypose and the generator's state. Planning changes
    nothing in the scene.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        self._kinematics = scene.arm_pair.kinematics
        self._checker = CollisionChecker(scene)

    def plan(self, keypose: BimanualKeypose, rng: np.random.Generator) -> Plan:
        """Joint actions that bring both arms to a keypose, together, and then set the grippers.

        An arm whose keypose ignores collisions moves along a straight line (or, if that is infeasible, through joint
        space to the nearest posture). Otherwise the arm moves through free space and around obstacles, including the
        other arm's motion. An arm does not move if its target is where it was last sent.

        Args:
            keypose: targets of both arms.
            rng: used only if a way around obstacles has to be searched.

        Raises:
            KeyposeFailure: a target outside the workspace or out of reach, or no collision-free path.
        """
        commanded = by_arm(self._scene.commanded)
        motion = _Motion({arm: commanded[arm.ordinal, :-1].astype(np.float64) for arm in ARMS})
        straight: dict[Arm, Pose] = {}
        free: dict[Arm, Pose] = {}
        for arm in ARMS:
            target, start = keypose[arm].pose, motion.start[arm]
            if is_at_target(self._kinematics[arm], start, target.matrix):
                motion.paths[arm], motion.paces[arm] = JointPath(np.stack([start, start])), FREE
                continue
            if not VOXEL_WORKSPACE.contains(target.position):
                allowed = f"from {VOXEL_WORKSPACE.lower} to below {VOXEL_WORKSPACE.upper}"
                place = f"position {_numbers(target.position)} m, allowed {allowed}"
                raise KeyposeFailure(arm, f"outside the workspace: {place}")
            (straight if keypose[arm].ignore_collisions else free)[arm] = target
        self._add_straight(motion, straight)
        if free:
            self._add_free(motion, free, rng)
        return self._timed(motion, keypose, commanded[:, -1])

    # -- kinds of motion ----------------------------------------------------------------------------------

    def _add_straight(self, motion: _Motion, targets: dict[Arm, Pose]) -> None:
        requests = [
            LineRequest(self._kinematics[arm], motion.start[arm], target.matrix)
            for arm, target in targets.items()
        ]
        for arm, line in zip(targets, straight_lines(requests), strict=True):
            if line is None:
                start = motion.start[arm]
                line = np.stack([start, self._goals(arm, start, targets[arm])[0]])
                motion.line_fallbacks += 1
            motion.paths[arm] = JointPath(line)
            motion.paces[arm] = PUSHING if is_beside_heavy(self._scene, arm) else CONTACT

    def _add_free(self, motion: _Motion, targets: dict[Arm, Pose], rng: np.random.Generator) -> None:
        candidates = {arm: self._goals(arm, motion.start[arm], pose) for arm, pose in targets.items()}
        start = motion.start
        self._checker.update_from_scene()
        rules = self._checker.free_motion_rules(
            targets, props_in_hands(self._scene), start[Arm.LEFT], start[Arm.RIGHT]
        )
        goals, obstacle = self._free_goals(motion, rules, candidates)
        for goal in goals:
            paths = {arm: JointPath(np.stack([start[arm], goal[arm]])) for arm in targets}
            if not self._is_free(rules, motion.paths | paths):
                paths = self._search(motion, rules, goal, rng)
            if paths is not None:
                motion.paths |= paths
                motion.paces |= dict.fromkeys(paths, FREE)
                return
        reason = f"the goal is not free of collisions: {obstacle}"
        if goals:
            tried = f"{RRT_ITERATIONS} iterations for each of {len(goals)} goal postures"
            reason = f"no collision-free path in {tried}"
        raise KeyposeFailure(next(iter(targets)) if len(targets) == 1 else "both", reason)

    def _goals(self, arm: Arm, start: Array, target: Pose) -> list[Array]:
        goals = goal_postures(self._kinematics[arm], start, target.matrix)
        if not goals:
            pose = f"position {_numbers(target.position)} m, quaternion wxyz {_numbers(target.quat_wxyz)}"
            raise KeyposeFailure(arm, f"unreachable: no joint solution for {pose}")
        return goals

    def _free_goals(
        self, motion: _Motion, rules: CollisionRules, candidates: dict[Arm, list[Array]]
    ) -> tuple[list[dict[Arm, Array]], str | None]:
        """The first few collision-free combinations of goal postures, and the first obstacle of others."""
        goals: list[dict[Arm, Array]] = []
        first_obstacle = None
        ends = {arm: path.knots[-1] for arm, path in motion.paths.items()}
        for goal, obstacle in free_goals(self._checker, rules, ends, candidates):
            if obstacle is None:
                goals.append(goal)
                if len(goals) == MAX_GOALS:
                    break
            first_obstacle = first_obstacle or obstacle
        return goals, first_obstacle

    def _is_free(self, rules: CollisionRules, paths: dict[Arm, JointPath]) -> bool:
        """Whether both arms, moving along the same path parameter, stay free of collisions."""
        travel = max(np.abs(np.diff(path.knots, axis=0)).max(axis=1).sum() for path in paths.values())
        fractions = np.linspace(0.0, 1.0, int(np.ceil(travel / PATH_CHECK_RAD)) + 2)[1:]
        left, right = (paths[arm].at(fractions) for arm in ARMS)
        return all(self._checker.is_free(rules, *postures) for postures in zip(left, right, strict=True))

    def _search(
        self, motion: _Motion, rules: CollisionRules, goal: dict[Arm, Array], rng: np.random.Generator
    ) -> dict[Arm, JointPath] | None:
        """Paths around obstacles for the arms in `goal`, in step with each other, since they are checked together."""
        others = {
            arm: path.knots[:1] if path.is_still else path.at(SWEPT_SHARES)
            for arm, path in motion.paths.items()
        }

        def is_free(joints: Array) -> bool:
            moving = dict(zip(goal, joints.reshape(-1, JOINTS_PER_ARM), strict=True))
            if not others:
                return self._checker.is_free(rules, moving[Arm.LEFT], moving[Arm.RIGHT])
            ((other, postures),) = others.items()
            swept = ({other: posture} | moving for posture in postures)
            return all(self._checker.is_free(rules, both[Arm.LEFT], both[Arm.RIGHT]) for both in swept)

        pair = self._scene.arm_pair
        knots = rrt_connect(
            np.concatenate([motion.start[arm] for arm in goal]),
            np.concatenate(list(goal.values())),
            np.tile(pair.joint_lower + LIMIT_SAFETY_RAD, len(goal)),
            np.tile(pair.joint_upper - LIMIT_SAFETY_RAD, len(goal)),
            is_free,
            rng,
            RRT_ITERATIONS,
        )
        if knots is None:
            return None
        per_arm = np.split(rounded(knots, is_free), len(goal), axis=1)
        return {arm: JointPath(path) for arm, path in zip(goal, per_arm, strict=True)}

    # -- timing -------------------------------------------------------------------------------------------

    def _timed(self, motion: _Motion, keypose: BimanualKeypose, grippers: NDArray[np.float32]) -> Plan:
        """Sample both paths at control ticks, then rest, then set the grippers, whose openings (2,) at the start are given."""
        fractions = tick_fractions([motion.paths[arm] for arm in ARMS], [motion.paces[arm] for arm in ARMS])
        ticks = len(fractions)
        opened = np.array([float(keypose[arm].gripper_open) for arm in ARMS], dtype=np.float32)
        waiting = GRIPPER_FRAMES if (opened != grippers).any() else 0
        arm_actions = np.empty((ticks + REST_TICKS + waiting, len(ARMS), ARM_ACTION_DIM), dtype=np.float32)
        for arm in ARMS:
            arm_actions[:ticks, arm.ordinal, :-1] = motion.paths[arm].at(fractions)
            arm_actions[ticks:, arm.ordinal, :-1] = motion.paths[arm].knots[-1]
        arm_actions[: ticks + REST_TICKS, :, -1] = grippers
        arm_actions[ticks + REST_TICKS :, :, -1] = opened
        return Plan(arm_actions.reshape(-1, JOINT_ACTION_DIM), motion.line_fallbacks)


def _numbers(values: Array) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in values) + ")"
