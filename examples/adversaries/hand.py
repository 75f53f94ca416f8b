"""Moves one hand by joint actions, as fast as the arm allows, in code that can read the scene at every tick."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import rotation_vector
from lerobot_bimanual.joint_action import ARM_ACTION_DIM, by_arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Move
from lerobot_env_bimanual.motion.feasibility import goal_postures
from lerobot_env_bimanual.motion.lines import LineRequest, straight_lines
from lerobot_env_bimanual.world.servo_commands import TICK_S

type Moves = Iterator[Move]
JOINT_SPEED_RAD_S = 1.9
TURN_RAD_S = 2.5
DAMPING = 1e-4
SLOWER = 1.3
"""Of a motion that starts and ends smoothly, against one at the same speed all the way."""


class OutOfReach(Exception):
    """A pose that the arm cannot have; the way is given up."""


class Hand:
    """The hand of one arm in an episode; the other arm stays as it is."""

    def __init__(self, env: BimanualEnv, arm: Arm):
        self.scene, self.arm = env.scene, arm
        self.kinematics = env.scene.arm_pair.kinematics[arm]
        self._action = env.scene.commanded
        self._own = by_arm(self._action)[arm.ordinal]

    @property
    def joints(self) -> NDArray[np.float64]:
        """(7,) commanded, rad."""
        return self._own[: ARM_ACTION_DIM - 1].astype(np.float64)

    @property
    def commanded(self) -> Pose:
        """Where the hand is sent."""
        return self.kinematics.pose(self.joints)

    def tick(self, joints: ArrayLike | None = None) -> Move:
        """One tick to other joints (7,), or where it is."""
        if joints is not None:
            self._own[: ARM_ACTION_DIM - 1] = joints
        return Move(f"{self.arm} hand", self._action.copy())

    def hold(self, ticks: int) -> Moves:
        """Stay."""
        return (self.tick() for _ in range(ticks))

    def grip(self, opening: float, ticks: int = 10) -> Moves:
        """Open to a share from 0 to 1, or close."""
        self._own[-1] = opening
        yield from self.hold(ticks)

    def go(self, pose: Pose, which: int = 0) -> Moves:
        """To a pose by the shortest way of the joints."""
        goals = goal_postures(self.kinematics, self.joints, pose.matrix)
        if not goals:
            raise OutOfReach(f"{pose.position.round(3)}")
        yield from self.follow(goals[min(which, len(goals) - 1)][None])

    def line(self, pose: Pose, speed_m_s: float = 0.5) -> Moves:
        """To a pose in a straight line, where there is one."""
        (line,) = straight_lines([LineRequest(self.kinematics, self.joints, pose.matrix)])
        if line is None:
            yield from self.go(pose)
            return
        way_m = float(np.linalg.norm(pose.position - self.commanded.position))
        yield from self.follow(line, way_m / speed_m_s)

    def follow(self, knots: NDArray, least_s: float = 0.0) -> Moves:
        """Through joints (n, 7) with a smooth start and end, and wait until the arm has caught up."""
        path = np.vstack([self.joints, knots])
        steps = np.abs(np.diff(path, axis=0)).max(axis=1)
        shares = np.append(0.0, np.cumsum(steps)) / max(steps.sum(), 1e-9)
        ticks = int(np.ceil(SLOWER * max(steps.sum() / JOINT_SPEED_RAD_S, least_s) / TICK_S))
        times = np.arange(1, ticks + 1) / max(ticks, 1)
        for share in times**2 * (3 - 2 * times):
            yield self.tick([np.interp(share, shares, column) for column in path.T])
        yield from self.hold(2)

    def servo(
        self, pose: Callable[[], Pose], ticks: int, speed_m_s: float = 0.8, within_m: float = 0.01
    ) -> Moves:
        """Move towards a pose, computed again at every tick, until the command is within `within_m` of it."""
        for _ in range(ticks):
            now, target = self.commanded, pose()
            way, turn = target.position - now.position, rotation_vector(target.rotation @ now.rotation.T)
            distance = float(np.linalg.norm(way))
            way *= min(1.0, speed_m_s * TICK_S / max(distance, 1e-9))
            turn *= min(1.0, TURN_RAD_S * TICK_S / max(float(np.linalg.norm(turn)), 1e-9))
            poses, jacobians = self.kinematics.poses_and_jacobians(self.joints[None])
            base = now.rotation @ poses[0, :3, :3].T
            jacobian = np.vstack([base @ jacobians[0, :3], base @ jacobians[0, 3:]])
            damped = jacobian @ jacobian.T + DAMPING * np.eye(6)
            step = jacobian.T @ np.linalg.solve(damped, np.concatenate([way, turn]))
            step /= max(1.0, np.abs(step).max() / (JOINT_SPEED_RAD_S * TICK_S))
            lower, upper = self.kinematics.lower + 0.005, self.kinematics.upper - 0.005
            yield self.tick(np.clip(self.joints + step, lower, upper))
            if distance < within_m:
                return
