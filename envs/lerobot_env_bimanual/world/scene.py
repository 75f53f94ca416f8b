"""The simulated world of one task: two arms, a table, cameras and the task's props."""

import copy
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import GRIPPERS, JOINT_ACTION_DIM, by_arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.options import STANDARD
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.alterations import Alterations
from lerobot_env_bimanual.world.appearance import NOMINAL, Appearance
from lerobot_env_bimanual.world.arena import build_spec
from lerobot_env_bimanual.world.scene_view import SceneView
from lerobot_env_bimanual.world.servo_commands import ServoCommands

MAX_SETTLE_TICKS = 8
"""Control ticks after placing the props, before the episode starts: at most 0.4 s, in which props come to rest."""

RESETTABLE_FIELDS = ("body_pos", "body_quat", "geom_rgba")
"""Model fields that a task may change at reset: where static props stand, and colours."""

FULL_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
SLEEP_FIELDS = tuple(name for name in dir(mujoco.MjData) if "awake" in name or "asleep" in name)
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
        altered: those of altered fields; empty where nothing is altered.
        appearance: how the episode looks.
        scales: as of `SceneView`.
        ticks: control ticks since the episode started.
        unstable: whether MuJoCo has warned in this episode.
    """

    physics: NDArray[np.float64]
    sleep: tuple[NDArray | int, ...]
    commanded: NDArray[np.float32]
    change: NDArray[np.float64]
    model_fields: tuple[NDArray, ...]
    altered: Mapping[str, NDArray]
    appearance: Appearance
    scales: Mapping[str, float]
    ticks: int
    unstable: bool


class Scene(SceneView):
    """A compiled world with its state.

    The order of an episode is `reset()`, any number of `place()`, `set_joint()` and `set_color()`, `settle()`,
    then `tick()` as often as wanted. Between calls all derived quantities of `data` (poses, contacts, camera
    frames) belong to the current positions and velocities.

    Args:
        props: the things besides robots and room, in the order in which they are compiled.
        patch: changes the model before it is compiled.
        setting: of its episodes.
        prop_set: index of `props` among the sets of the setting.

    Attributes:
        ticks: control ticks since the episode started (settling not counted).
    """

    def __init__(
        self,
        props: Sequence[Prop] = (),
        patch: Callable[[mujoco.MjSpec], None] | None = None,
        setting: str = STANDARD,
        prop_set: int = 0,
    ):
        self._home_action = np.array([*PANDA_PAIR.home_joints, 1.0] * len(ARMS), dtype=np.float32)
        spec = build_spec(props)
        if patch is not None:
            patch(spec)
        spec.nuserdata = 3 * len(spec.bodies)  # where each body was placed: a part of MuJoCo's state
        super().__init__(spec.compile(), self._home_action, props, setting)
        self._identity = f"{setting} {prop_set}".encode() if setting != STANDARD else b""
        self.ticks = 0
        self._pristine = tuple(getattr(self.model, field).copy() for field in RESETTABLE_FIELDS)
        self._alterations = Alterations(self.model)
        self._latched_unstable = False
        self._tree_of_dof = self.model.dof_treeid.copy()
        self._tree_awake = self.data.tree_awake
        self._prop_positions = self.data.qpos[self._finger_qpos.max() + 1 :]
        self._forgotten: tuple[bytes, bytes] | None = None
        self._servos = ServoCommands(self.model, self.data)
        self._options = self.model.opt
        self.reset()

    # -- episode ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Back to the compiled model: arms at home with open hands, props at the origin, nothing moves."""
        for field, pristine in zip(RESETTABLE_FIELDS, self._pristine, strict=True):
            getattr(self.model, field)[:] = pristine
        self._alterations.revert()
        self.appearance = NOMINAL
        self.scales = {}
        mujoco.mj_resetData(self.model, self.data)
        for arm in ARMS:
            self.data.qpos[self.joint_qpos[arm.ordinal]] = self.arm_pair.home_joints
            self.data.qpos[self._finger_qpos[arm.ordinal]] = self.arm_pair.finger_travel_m
        self._commanded = self._home_action
        self._servos.restore(0.0)
        self.data.ctrl[GRIPPERS] = self.arm_pair.finger_travel_m
        self.ticks = 0
        self._latched_unstable = False
        self._forgotten = None
        self._refresh()

    def place(self, body: str, pose: Pose, joints: ArrayLike = ()) -> None:
        """Put a prop somewhere: between `reset` and `settle`, or at any time if nothing holds it.

        Args:
            body: root body of a prop, free or static.
            pose: world pose of the body's frame.
            joints: of a free prop, (n,) values of the first of its other joints, in the model's order.
        """
        index = self.model.body(body).id
        joint = self.model.body_jntadr[index]
        if joint >= 0 and self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            address = self.model.jnt_qposadr[joint]
            self.data.qpos[address : address + 7] = [*pose.position, *pose.quat_wxyz]
            self.data.qpos[address + 7 : address + 7 + np.size(joints)] = joints
        else:
            self.model.body_pos[index] = pose.position
            self.model.body_quat[index] = pose.quat_wxyz
        self.placed_m(body)[:] = pose.position
        self._refresh()

    def set_joint(self, joint: str, value: float) -> None:
        """Set a hinge (rad) or slide (m) of a prop; only between `reset` and `settle`."""
        self.data.qpos[self.model.joint(joint).qposadr[0]] = value
        self._refresh()

    def set_color(self, geom: str, rgba: ArrayLike) -> None:
        """Colour a geom until the next reset."""
        self.model.geom(geom).rgba = rgba

    def place_like(self, other: "Scene") -> None:
        """Place and colour props as in another scene, right after `reset`; its props come first here, but shapes may differ."""
        self.data.qpos[: other.model.nq] = other.data.qpos
        self.data.userdata[: other.model.nuserdata] = other.data.userdata
        for field, pristine in zip(RESETTABLE_FIELDS, other._pristine, strict=True):
            values = getattr(other.model, field)
            changed = np.flatnonzero((values != pristine).any(axis=1))
            getattr(self.model, field)[changed] = values[changed]
        self._refresh()

    def pose_arms(self, joints: ArrayLike) -> None:
        """Have the arms start at other joints (2, 7), rad, than at home; only between `reset` and `settle`."""
        arms = by_arm(commanded := self._home_action.copy())
        arms[:, :-1] = joints
        for arm in ARMS:
            self.data.qpos[self.joint_qpos[arm.ordinal]] = arms[arm.ordinal, :-1]
        self._commanded = commanded
        self._refresh()

    def alter(self, **fields: NDArray) -> None:
        """Make bodies, joints or motors different until the next reset, by values for some `FIELDS` of `world.alterations`.

        Raises:
            ValueError: a field that cannot be altered.
        """
        self._alterations.apply(fields)
        self._refresh()

    def settle(self, max_ticks: int = MAX_SETTLE_TICKS) -> None:
        """Let the props come to rest while the arms hold still, and start the episode's clock.

        It takes until everything but the arms sleeps, for most tasks one or two ticks.
        """
        for _ in range(max_ticks):
            self.tick(self._commanded)
            if self.data.ntree_awake <= len(ARMS):
                break
        self.ticks = 0

    def tick(self, joint_action: ArrayLike, observers: Sequence[Callable[[], None]] = ()) -> None:
        """Advance one control tick of 50 ms.

        Args:
            joint_action: (16,) left joints in rad, left gripper 0 closed .. 1 open, then the same of the right.
            observers: called after every step of physics, while `data` holds its contacts and forces; they only read.
        """
        last, self._commanded = self._commanded, np.array(joint_action, dtype=np.float32)
        commands = self._servos.of_tick(last, self._commanded)
        model, data, ctrl = self.model, self.data, self.data.ctrl[:JOINT_ACTION_DIM]
        # Enabled only here: with it, MuJoCo skips sleeping bodies in every computation of poses.
        self._options.enableflags |= SLEEP
        try:
            # MuJoCo's step is step1 (positions to contacts) and step2 (forces to new positions). Starting with the
            # second and ending with the first costs nothing and leaves poses and contacts up to date.
            for number, command in enumerate(commands):
                ctrl[:] = command
                (mujoco.mj_step if number else mujoco.mj_step2)(model, data)
                for observe in observers:
                    observe()
            mujoco.mj_step1(model, data)
        finally:  # also where an observer raised
            self._options.enableflags &= ~SLEEP
        if data.ntree_awake < model.ntree:
            self._reset_sleeping_dynamics()
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
        """SHA-256, in hex, of everything that decides how the scene goes on, and of the colours that the task sets.

        Changes by perturbations that affect images only are excluded, so that a seed's episode has the same hashes under them.
        """
        digest = hashlib.sha256(self._identity + self._physics_state().tobytes())
        digest.update(self.data.tree_asleep.tobytes())
        digest.update(self._commanded.tobytes())
        digest.update(self._servos.change.tobytes())
        for field in RESETTABLE_FIELDS:
            digest.update(getattr(self.model, field).tobytes())
        for field, values in sorted(self._alterations.values().items()):
            digest.update(field.encode() + values.tobytes())
        return digest.hexdigest()

    def save_state(self) -> SceneState:
        """A copy of the state from which `restore_state` continues bit-exactly."""
        return SceneState(
            physics=self._physics_state(),
            sleep=tuple(copy.copy(getattr(self.data, field)) for field in SLEEP_FIELDS),
            commanded=self._commanded.copy(),
            change=self._servos.change.copy(),
            model_fields=tuple(getattr(self.model, field).copy() for field in RESETTABLE_FIELDS),
            altered={field: values.copy() for field, values in self._alterations.values().items()},
            appearance=self.appearance,
            scales=dict(self.scales),
            ticks=self.ticks,
            unstable=self.unstable,
        )

    def restore_state(self, state: SceneState) -> None:
        """Continue from a state of this scene, or of another one with the same props and robots."""
        for field, values in zip(RESETTABLE_FIELDS, state.model_fields, strict=True):
            getattr(self.model, field)[:] = values
        self._alterations.revert()
        self._alterations.apply(state.altered)
        self.appearance = state.appearance
        self.scales = dict(state.scales)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, state.physics, FULL_STATE)
        self._commanded = state.commanded.copy()
        self._servos.restore(state.change)
        self.ticks = state.ticks
        self._latched_unstable = state.unstable
        self._forgotten = None
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

    def _refresh(self) -> None:
        """Recompute everything that follows from positions and velocities."""
        mujoco.mj_step1(self.model, self.data)

    def _reset_sleeping_dynamics(self) -> None:
        """Make inertias and accelerations of sleeping bodies depend on positions alone.

        MuJoCo keeps their values from just before a body fell asleep, and starts from them when it wakes. They are
        not part of MuJoCo's state, from which an episode must continue bit for bit.
        """
        slept = self._tree_awake.tobytes(), self._prop_positions.tobytes()
        if slept == self._forgotten:
            return
        self._forgotten = slept
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
