"""Commands of the servos at each step of physics within a control tick."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM, Arm
from lerobot_bimanual.joint_action import ARM_ACTION_DIM, CONTROL_HZ, JOINT_ACTION_DIM, by_arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S

TICK_S = 1 / CONTROL_HZ
STEPS_PER_TICK = round(TICK_S / PHYSICS_STEP_S)


class ServoCommands:
    """Computes the servo commands of successive ticks.

    Arm targets follow the quadratic B-spline of the actions, half a tick behind them: their velocity is continuous, and
    their acceleration within a tick follows from the last three actions. They are advanced by the lag of the servos due
    to velocity and inertia, so that the arms follow without delay. Finger targets move to the commanded opening at the
    fingers' speed.

    Args:
        model: compiled; the arms come first in it.
        data: its state, of which inertia, fingers and the last commands are read.

    Attributes:
        change: (16,) by how much the last action differed from the one before.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self._model, self._data = model, data
        self._shares = _spline_shares(PANDA_PAIR.servo_lead_s / TICK_S)
        self.change = np.zeros(JOINT_ACTION_DIM)
        names = [PANDA_PAIR.joint_names(arm) for arm in ARMS]
        self._dofs = np.array([[model.joint(name).dofadr[0] for name in each] for each in names])  # (2, 7)
        self._lead_per_force = 1 / (TICK_S**2 * PANDA_PAIR.position_gain_nm_rad)
        fingers = map(PANDA_PAIR.finger_names, ARMS)
        self._fingers = [[model.joint(name).qposadr[0] for name in names] for names in fingers]
        self._finger_reach = PANDA_PAIR.finger_speed_m_s * PHYSICS_STEP_S * np.arange(1, STEPS_PER_TICK + 1)

    def restore(self, change: ArrayLike) -> None:
        """Go on from a tick in which the action changed by this much (16,)."""
        self.change = np.full(JOINT_ACTION_DIM, change, np.float64)

    def of_tick(self, last: NDArray[np.float32], action: NDArray[np.float32]) -> NDArray[np.float64]:
        """Commands (25, 16), one for each step of physics, of the tick that leads from one joint action (16,) to the next."""
        before, self.change = self.change, np.subtract(action, last, dtype=np.float64)
        # How far the targets have to lie ahead for the servos to accelerate the arms as the actions tell.
        acceleration, force = np.zeros((2, self._model.nv))
        acceleration[self._dofs] = by_arm(self.change - before)[:, :JOINTS_PER_ARM]
        mujoco.mj_mulM(self._model, self._data, force, acceleration)
        lead = np.zeros(JOINT_ACTION_DIM)
        by_arm(lead)[:, :JOINTS_PER_ARM] = force[self._dofs] * self._lead_per_force
        of_before, of_change = self._shares
        rows = of_before * before + of_change * self.change + (last - before * 0.5 + lead)
        for arm in ARMS:
            gripper = ARM_ACTION_DIM * arm.ordinal + JOINTS_PER_ARM
            rows[:, gripper] = self._finger_travel_m(arm, action.item(gripper), self._data.ctrl.item(gripper))
        return rows

    def _finger_travel_m(self, arm: Arm, opening: float, last: float) -> NDArray[np.float64]:
        """Finger targets (25,) on the way to an opening, given the last one.

        The motion begins at the last command, or at the fingers' position if that is nearer to the target: a hand that
        opens does not have to undo its squeeze first.
        """
        target = PANDA_PAIR.finger_target_m(opening)
        one, other = self._fingers[arm.ordinal]
        fingers = (self._data.qpos.item(one) + self._data.qpos.item(other)) / 2
        start = min(last, fingers) if target < fingers else max(last, fingers)
        way = target - start
        return start + np.copysign(np.minimum(self._finger_reach, abs(way)), way)


def _spline_shares(lead_ticks: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shares (25, 1) of the last and of the new change of action in the command at each step of physics.

    The B-spline starts a tick in the middle between the last two actions; its velocity goes from the last to the
    new change of action per tick.
    """
    u = np.arange(1, STEPS_PER_TICK + 1)[:, None] / STEPS_PER_TICK
    return u - u**2 / 2 + lead_ticks * (1 - u), u**2 / 2 + lead_ticks * u
