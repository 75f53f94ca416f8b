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
ROW_BYTES = JOINT_ACTION_DIM * np.dtype(np.float64).itemsize


class ServoCommands:
    """The commands of one tick after the other.

    Arm targets follow the quadratic B-spline of the actions, half a tick behind them: their velocity is continuous, and
    their acceleration within a tick is that which the last three actions tell. They are advanced by what the servos
    lag for velocity and inertia, so that the arms follow them without delay. Finger targets go to where they are sent
    at the fingers' speed.

    Args:
        model: compiled; the arms come first in it.
        data: its state, of which inertia, fingers and the last commands are read.

    Attributes:
        change: (16,) by how much the last action differed from the one before.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self._model, self._data = model, data
        self._qpos, self._ctrl = data.qpos, data.ctrl
        self._rows = np.empty((STEPS_PER_TICK, JOINT_ACTION_DIM))
        self._parts = np.empty((STEPS_PER_TICK, 2, JOINT_ACTION_DIM))
        self._shares = _spline_shares(PANDA_PAIR.servo_lead_s / TICK_S)
        self._changes = np.zeros((2, JOINT_ACTION_DIM))
        self._last_change, self.change = self._changes
        self._offset, self._lead = np.zeros((2, JOINT_ACTION_DIM))
        self._acceleration, self._force = np.zeros((2, model.nv))
        self._last_change_of_joints, self._change_of_joints = by_arm(self._changes)[..., :JOINTS_PER_ARM]
        self._lead_of_joints = by_arm(self._lead)[:, :JOINTS_PER_ARM]
        dofs = [model.joint(PANDA_PAIR.joint_names(arm)[0]).dofadr[0] for arm in ARMS]
        self._acceleration_of_joints, self._force_of_joints = (
            _of_joints(vector, *dofs) for vector in (self._acceleration, self._force)
        )
        self._lead_per_force = 1 / (TICK_S**2 * PANDA_PAIR.position_gain_nm_rad)
        fingers = map(PANDA_PAIR.finger_names, ARMS)
        self._fingers = [[model.joint(name).qposadr[0] for name in names] for names in fingers]
        self._finger_reach = PANDA_PAIR.finger_speed_m_s * PHYSICS_STEP_S * np.arange(1, STEPS_PER_TICK + 1)
        self._rests = True

    def restore(self, change: ArrayLike) -> None:
        """Go on from a tick in which the action changed by this much (16,)."""
        self.change[:] = change
        self._rests = not self.change.any()

    def of_tick(self, last: NDArray[np.float32], action: NDArray[np.float32]) -> list[bytes]:
        """Commands of the tick that leads from one joint action (16,) to the next.

        Returns:
            The bytes of 16 float64 for each step of physics; or of all steps at once, if they are the same. (Between
            two steps every NumPy call runs from a cold cache; copying bytes costs half as much.)
        """
        rested, self._rests = self._rests, action.tobytes() == last.tobytes()
        self._last_change[:] = self.change
        np.subtract(action, last, out=self.change, dtype=np.float64)
        fingers = [self._finger_travel_m(arm, action.item(_gripper(arm))) for arm in ARMS]
        if not (rested and self._rests):
            rows = self._moving_arms(last)
        elif any(isinstance(travel_m, np.ndarray) for travel_m in fingers):
            rows = np.add(last, 0.0, out=self._rows, dtype=np.float64)
        else:
            rows = np.add(last, 0.0, out=self._offset, dtype=np.float64)
        for arm, travel_m in zip(ARMS, fingers, strict=True):
            rows[..., _gripper(arm)] = travel_m
        commands = rows.tobytes()
        return [commands[start : start + ROW_BYTES] for start in range(0, len(commands), ROW_BYTES)]

    def _moving_arms(self, last: NDArray[np.float32]) -> NDArray[np.float64]:
        """(25, 16) along the spline from the last action (16,) on; the grippers' entries mean nothing."""
        rows, parts, offset = self._rows, self._parts, self._offset
        # How far the targets have to lie ahead for the servos to accelerate the arms as the actions tell.
        np.subtract(self._change_of_joints, self._last_change_of_joints, out=self._acceleration_of_joints)
        mujoco.mj_mulM(self._model, self._data, self._force, self._acceleration)
        np.multiply(self._force_of_joints, self._lead_per_force, out=self._lead_of_joints)
        np.multiply(self._last_change, 0.5, out=offset)
        np.subtract(last, offset, out=offset)
        np.add(offset, self._lead, out=offset)
        np.multiply(self._shares, self._changes, out=parts)
        np.add(parts[:, 0], parts[:, 1], out=rows)
        return np.add(rows, offset, out=rows)

    def _finger_travel_m(self, arm: Arm, opening: float) -> float | NDArray[np.float64]:
        """Finger targets on the way to an opening, (25,); or a single number if they stay.

        The way begins at the last command, or where the fingers are if that is nearer: a hand that lets go does not
        have to take back at first how hard it pressed.
        """
        target = PANDA_PAIR.finger_target_m(opening)
        one, other = self._fingers[arm.ordinal]
        fingers, last = (self._qpos.item(one) + self._qpos.item(other)) / 2, self._ctrl.item(_gripper(arm))
        start = min(last, fingers) if target < fingers else max(last, fingers)
        way = target - start
        if not way:
            return start
        return start + np.copysign(np.minimum(self._finger_reach, abs(way)), way)


def _gripper(arm: Arm) -> int:
    """Index of the gripper in a joint action."""
    return ARM_ACTION_DIM * arm.ordinal + JOINTS_PER_ARM


def _of_joints(vector: NDArray[np.float64], left: int, right: int) -> NDArray[np.float64]:
    """The arm joints' part (2, 7) of a vector over all degrees of freedom, given where that of each arm begins."""
    return vector[left : 2 * right - left].reshape(len(ARMS), right - left)[:, :JOINTS_PER_ARM]


def _spline_shares(lead_ticks: float) -> NDArray[np.float64]:
    """(25, 2, 16) shares of the last and of the new change of action in the command at each step of physics.

    The B-spline starts a tick in the middle between the last two actions; its velocity goes from the last to the
    new change of action per tick.
    """
    u = np.arange(1, STEPS_PER_TICK + 1) / STEPS_PER_TICK
    shares = np.stack([u - u**2 / 2 + lead_ticks * (1 - u), u**2 / 2 + lead_ticks * u], axis=1)
    return np.repeat(shares[..., None], JOINT_ACTION_DIM, axis=-1)
