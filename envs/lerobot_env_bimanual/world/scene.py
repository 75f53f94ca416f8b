"""The simulated world of one task: two arms, a table, cameras and the task's props."""

import copy
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import ARM_ACTION_DIM, GRIPPERS, JOINT_ACTION_DIM, by_arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.robots.arm_pair import ArmPair
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S, build_spec
from lerobot_env_bimanual.world.scene_view import SceneView

TICK_S = 1 / CONTROL_HZ
STEPS_PER_TICK = round(TICK_S / PHYSICS_STEP_S)
MAX_SETTLE_TICKS = 8
"""Control ticks after placing the props, before the episode starts: at most 0.4 s, in which props come to rest."""

CTRL_BYTES = JOINT_ACTION_DIM * np.dtype(np.float64).itemsize
RESETTABLE_FIELDS = ("body_pos", "body_quat", "geom_rgba")
"""Model fields that a task may change at reset: where static props stand, and colours."""

FULL_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
SLEEP_FIELDS = (
    "tree_asleep",
    "tree_awake",
    "body_awake",
    "body_awake_ind",
    "parent_awake_ind",
    "dof_awake_ind",
    "ntree_awake",
    "nbody_awake",
    "nparent_awake",
    "nv_awake",
)
"""Data fields that say which things sleep."""


@dataclass(frozen=True, eq=False)
class SceneState:
    """Everything that decides how a scene goes on; opaque, made by `Scene.save_state`.

    Attributes:
        physics: MuJoCo's integration state. (Its smaller physics state is not enough: solver warm starts count.)
        sleep: the values of `SLEEP_FIELDS`, which are not part of the integration state.
        commanded: (16,) the joint action of the last tick.
        change: (16,) by how much it differed from the one of the tick before.
        model_fields: the values of `RESETTABLE_FIELDS`.
        ticks: control ticks since the episode started.
        unstable: whether MuJoCo has warned in this episode.
    """

    physics: NDArray[np.float64]
    sleep: tuple[NDArray | int, ...]
    commanded: NDArray[np.float32]
    change: NDArray[np.float64]
    model_fields: tuple[NDArray, ...]
    ticks: int
    unstable: bool


class Scene(SceneView):
    """A compiled world with its state.

    The order of an episode is `reset()`, any number of `place()`, `set_joint()` and `set_color()`, `settle()`,
    then `tick()` as often as wanted. Between calls all derived quantities of `data` (poses, contacts, camera
    frames) belong to the current positions and velocities.

    Args:
        props: the things besides robots and room, in the order in which they are compiled.
        arm_pair: the robots.

    Attributes:
        ticks: control ticks since the episode started (settling not counted).
    """

    def __init__(self, props: Sequence[Prop] = (), arm_pair: ArmPair = PANDA_PAIR):
        self._home_action = np.array([*arm_pair.home_joints, 1.0] * len(ARMS), dtype=np.float32)
        super().__init__(build_spec(props, arm_pair).compile(), arm_pair, self._home_action)
        self.ticks = 0
        self._pristine = tuple(getattr(self.model, field).copy() for field in RESETTABLE_FIELDS)
        self._latched_unstable = False
        self._tree_of_dof = self.model.dof_treeid.copy()
        self._index_actuators()
        self._last_share, self._new_share = self._make_spline_shares()
        self._ctrl_rows = np.empty((STEPS_PER_TICK, JOINT_ACTION_DIM))
        self.reset()

    # -- episode ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Back to the compiled model: arms at home with open hands, props at the origin, nothing moves."""
        for field, pristine in zip(RESETTABLE_FIELDS, self._pristine, strict=True):
            getattr(self.model, field)[:] = pristine
        mujoco.mj_resetData(self.model, self.data)
        for arm in ARMS:
            self.data.qpos[self._joint_qpos[arm.ordinal]] = self.arm_pair.home_joints
            self.data.qpos[self._finger_qpos[arm.ordinal]] = self.arm_pair.finger_travel_m
        self._commanded, self._change = self._home_action, np.zeros(JOINT_ACTION_DIM)
        self.data.ctrl[GRIPPERS] = self.arm_pair.finger_travel_m
        self.ticks = 0
        self._latched_unstable = False
        self._refresh()

    def place(self, body: str, pose: Pose) -> None:
        """Put a prop somewhere; only between `reset` and `settle`.

        Args:
            body: root body of a prop, free or static.
            pose: world pose of the body's frame.
        """
        index = self.model.body(body).id
        joint = self.model.body_jntadr[index]
        if joint >= 0 and self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            address = self.model.jnt_qposadr[joint]
            self.data.qpos[address : address + 3] = pose.position
            self.data.qpos[address + 3 : address + 7] = pose.quat_wxyz
        else:
            self.model.body_pos[index] = pose.position
            self.model.body_quat[index] = pose.quat_wxyz
        self._refresh()

    def set_joint(self, joint: str, value: float) -> None:
        """Set a hinge (rad) or slide (m) of a prop; only between `reset` and `settle`."""
        self.data.qpos[self.model.joint(joint).qposadr[0]] = value
        self._refresh()

    def set_color(self, geom: str, rgba: ArrayLike) -> None:
        """Colour a geom until the next reset."""
        self.model.geom(geom).rgba = rgba

    def settle(self, max_ticks: int = MAX_SETTLE_TICKS) -> None:
        """Let the props come to rest while the arms hold still, and start the episode's clock.

        It takes until everything but the arms sleeps, for most tasks one or two ticks.
        """
        for _ in range(max_ticks):
            self.tick(self._commanded)
            if self.data.ntree_awake <= len(ARMS):
                break
        self.ticks = 0

    def tick(self, joint_action: ArrayLike) -> None:
        """Advance one control tick of 50 ms.

        Arm targets follow the quadratic B-spline of the actions, half a tick behind them: their velocity is
        continuous, and their acceleration within a tick is that which the last three actions tell. They are advanced
        by what the servos lag for velocity and inertia, so that the arms follow them without delay. Finger
        targets go to where they are sent at the fingers' speed.

        Args:
            joint_action: (16,) left joints in rad, left gripper 0 closed .. 1 open, then the same of the right.
        """
        last, last_change = self._commanded.astype(np.float64), self._change
        self._commanded = np.array(joint_action, dtype=np.float32)
        self._change = self._commanded - last
        rows = self._ctrl_rows
        np.multiply(self._last_share, last_change, out=rows)
        rows += self._new_share * self._change
        rows += last - 0.5 * last_change + self._inertia_lead(self._change - last_change)
        self._ramp_fingers(rows)
        # Between two steps of physics every NumPy call runs from a cold cache; copying bytes costs half as much.
        commands, ctrl = rows.tobytes(), self._ctrl_bytes
        model, data, step = self.model, self.data, mujoco.mj_step
        # Only here, for what sleeps and what never moves is then left out of every computation of poses.
        model.opt.enableflags |= SLEEP
        # MuJoCo's step is step1 (positions to contacts) and step2 (forces to new positions). Starting with the
        # second and ending with the first costs nothing and leaves poses and contacts up to date.
        ctrl[:] = commands[:CTRL_BYTES]
        mujoco.mj_step2(model, data)
        for start in range(CTRL_BYTES, len(commands), CTRL_BYTES):
            ctrl[:] = commands[start : start + CTRL_BYTES]
            step(model, data)
        mujoco.mj_step1(model, data)
        model.opt.enableflags &= ~SLEEP
        if data.ntree_awake < model.ntree:
            self._forget_falling_asleep()
        self.ticks += 1

    @property
    def unstable(self) -> bool:
        """Whether MuJoCo has warned since reset.

        MuJoCo answers a diverging state by silently resetting it, which can look like success: an episode with
        any warning is a failure.
        """
        return self._latched_unstable or bool(np.any(self.data.warning.number))

    # -- state --------------------------------------------------------------------------------------------

    def state_hash(self) -> str:
        """SHA-256, in hex, of everything that decides how the scene goes on and how it looks."""
        digest = hashlib.sha256(self._physics_state().tobytes())
        digest.update(self.data.tree_asleep.tobytes())
        digest.update(self._commanded.tobytes())
        digest.update(self._change.tobytes())
        for field in RESETTABLE_FIELDS:
            digest.update(getattr(self.model, field).tobytes())
        return digest.hexdigest()

    def save_state(self) -> SceneState:
        """A copy of the state from which `restore_state` continues bit-exactly."""
        return SceneState(
            physics=self._physics_state(),
            sleep=tuple(copy.copy(getattr(self.data, field)) for field in SLEEP_FIELDS),
            commanded=self._commanded.copy(),
            change=self._change.copy(),
            model_fields=tuple(getattr(self.model, field).copy() for field in RESETTABLE_FIELDS),
            ticks=self.ticks,
            unstable=self.unstable,
        )

    def restore_state(self, state: SceneState) -> None:
        """Continue from a state of this scene, or of another one with the same props and robots."""
        for field, values in zip(RESETTABLE_FIELDS, state.model_fields, strict=True):
            getattr(self.model, field)[:] = values
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, state.physics, FULL_STATE)
        self._commanded, self._change = state.commanded.copy(), state.change.copy()
        self.ticks = state.ticks
        self._latched_unstable = state.unstable
        self._refresh()
        for field, value in zip(SLEEP_FIELDS, state.sleep, strict=True):
            if isinstance(value, int):
                setattr(self.data, field, value)
            else:
                getattr(self.data, field)[:] = value
        self.model.opt.enableflags |= SLEEP
        mujoco.mj_step1(self.model, self.data)
        self.model.opt.enableflags &= ~SLEEP

    # -- internals ----------------------------------------------------------------------------------------

    def _index_actuators(self) -> None:
        """Make sure that the first actuators are those of the joint action, and keep how it becomes commands."""
        pair = self.arm_pair
        order = [self.model.actuator(name).id for arm in ARMS for name in pair.actuator_names(arm)]
        if order != list(range(JOINT_ACTION_DIM)):
            raise ValueError(
                f"arm actuators must come first, in the order of the joint action; got ids {order}"
            )
        self._ctrl_bytes = memoryview(self.data.ctrl[:JOINT_ACTION_DIM]).cast("B")
        self._arm_entries = by_arm(np.arange(JOINT_ACTION_DIM))[:, :JOINTS_PER_ARM].ravel()
        self._arm_dofs = np.array(
            [self.model.joint(name).dofadr[0] for arm in ARMS for name in pair.joint_names(arm)]
        )
        self._generalised, self._force = np.zeros((2, self.model.nv))
        self._lead_per_force = 1 / (TICK_S**2 * np.tile(pair.position_gain_nm_rad, len(ARMS)))
        self._finger_addresses = self._finger_qpos.tolist()
        self._finger_reach = pair.finger_speed_m_s * PHYSICS_STEP_S * np.arange(1, STEPS_PER_TICK + 1)

    def _make_spline_shares(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(25, 1) shares of the last and of the new change of action in the command at each physics step.

        The B-spline starts a tick in the middle between the last two actions; its velocity goes from the last to the
        new change of action per tick.
        """
        u = (np.arange(1, STEPS_PER_TICK + 1) / STEPS_PER_TICK)[:, None]
        lead = self.arm_pair.servo_lead_s / TICK_S
        return u - u**2 / 2 + lead * (1 - u), u**2 / 2 + lead * u

    def _inertia_lead(self, change_of_change: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far (16,) the targets have to lie ahead for the servos to accelerate the arms as the actions tell."""
        self._generalised[self._arm_dofs] = change_of_change[self._arm_entries]
        mujoco.mj_mulM(self.model, self.data, self._force, self._generalised)
        lead = np.zeros(JOINT_ACTION_DIM)
        lead[self._arm_entries] = self._force[self._arm_dofs] * self._lead_per_force
        return lead

    def _ramp_fingers(self, rows: NDArray[np.float64]) -> None:
        """Write into `rows` (25, 16) the finger travels, in m, on the way to the commanded openings.

        The way begins at the last command, or where the fingers are if that is nearer: a hand that lets go does not
        have to take back at first how hard it pressed.
        """
        qpos = self.data.qpos
        for arm in ARMS:
            gripper = ARM_ACTION_DIM * arm.ordinal + JOINTS_PER_ARM
            target = self.arm_pair.finger_target_m(float(self._commanded[gripper]))
            one, other = self._finger_addresses[arm.ordinal]
            fingers, last = (float(qpos[one]) + float(qpos[other])) / 2, float(self.data.ctrl[gripper])
            start = min(last, fingers) if target < fingers else max(last, fingers)
            way = target - start
            ramp = np.copysign(np.minimum(self._finger_reach, abs(way)), way) if way else 0.0
            rows[:, gripper] = start + ramp

    def _refresh(self) -> None:
        """Recompute everything that follows from positions and velocities."""
        mujoco.mj_step1(self.model, self.data)

    def _forget_falling_asleep(self) -> None:
        """Make what sleeps a function of its position alone.

        MuJoCo leaves inertias and accelerations as they were a moment before a thing fell asleep, and starts from
        them when it wakes. They are not part of its state, from which an episode must continue bit for bit.
        """
        model, data = self.model, self.data
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        asleep = data.tree_awake[self._tree_of_dof] == 0
        data.qacc_smooth[asleep] = 0
        data.qacc_warmstart[asleep] = 0

    def _physics_state(self) -> NDArray[np.float64]:
        state = np.empty(mujoco.mj_stateSize(self.model, FULL_STATE))
        mujoco.mj_getState(self.model, self.data, state, FULL_STATE)
        return state
