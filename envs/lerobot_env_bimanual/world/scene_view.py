"""A read-only view of a world: poses of arms and props, and contacts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.options import STANDARD, VARIED
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.appearance import NOMINAL

MIN_SQUEEZE_N = 2.0
"""Force on each finger of a hand that grips; a hand that is only touched exerts none."""
MIN_GRIPPED_M = 0.001
"""Width of what is gripped; fingers that are closer have closed on each other."""


class SceneView:
    """A read-only view of a world, independent of how it is moved.

    Scripts and conditions are given this, so they work in the scene that physics drives and in one that a rehearsal
    sets by kinematics.

    Args:
        model: compiled MuJoCo model; an attribute, like `props` and `setting`.
        commanded: (16,) the joint action that the arms hold.
        props: the things besides robots and room.
        setting: of the episode.

    Attributes:
        data: the model's state; read it freely, change it only through the methods of a subclass.
        arm_pair: the robots.
        arm_of_body: (nbody,) number of the arm that each body belongs to; -1 for the room and props.
        appearance: how it looks where that differs from the model, and where its cameras are.
        joint_qpos: (2, 7) places of the arms' joints in `data.qpos`.
        scales: factor by which a body is larger than its prop's sizes, by name; 1 for names that are missing.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        commanded: NDArray[np.float32],
        props: Sequence[Prop] = (),
        setting: str = STANDARD,
    ):
        self.model, self.props, self.setting = model, tuple(props), setting
        self.data = mujoco.MjData(model)
        self.arm_pair = arm_pair = PANDA_PAIR
        bases = [model.body_rootid == model.body(arm_pair.base_body(arm)).id for arm in ARMS]
        self.arm_of_body = np.select(bases, [arm.ordinal for arm in ARMS], -1)
        self.appearance = NOMINAL
        self.scales: dict[str, float] = {}
        self._commanded = commanded
        self._geoms_of: dict[str | tuple[str, ...], NDArray[np.bool_]] = {}
        joints = [[model.joint(name) for name in arm_pair.joint_names(arm)] for arm in ARMS]
        fingers = [[model.joint(name) for name in arm_pair.finger_names(arm)] for arm in ARMS]
        self.joint_qpos = np.array([[joint.qposadr[0] for joint in arm] for arm in joints])
        self._finger_qpos = np.array([[joint.qposadr[0] for joint in arm] for arm in fingers])  # (2, 2)
        self._gripper = [model.actuator(arm_pair.actuator_names(arm)[-1]).id for arm in ARMS]
        self._tcp_site = [model.site(arm_pair.tcp_site(arm)).id for arm in ARMS]

    @property
    def commanded(self) -> NDArray[np.float32]:
        """The last joint action (16,)."""
        return self._commanded.copy()

    # -- arms ---------------------------------------------------------------------------------------------

    def tcp(self, arm: Arm) -> Pose:
        """World pose of the tool centre point: z approach, y opening of the fingers."""
        site = self._tcp_site[arm.ordinal]
        rotation = self.data.site_xmat[site].reshape(3, 3)
        return Pose(self.data.site_xpos[site], matrix_to_quat_wxyz(rotation))

    def joint_positions(self, arm: Arm) -> NDArray[np.float64]:
        """(7,) rad."""
        return self.data.qpos[self.joint_qpos[arm.ordinal]]

    def finger_positions(self, arm: Arm) -> NDArray[np.float64]:
        """(2,) m of travel, 0 closed."""
        return self.data.qpos[self._finger_qpos[arm.ordinal]]

    def gripper_opening(self, arm: Arm) -> float:
        """Measured opening, 0 closed .. 1 open."""
        return float(np.clip(self.finger_positions(arm).mean() / self.arm_pair.finger_travel_m, 0.0, 1.0))

    # -- props --------------------------------------------------------------------------------------------

    @property
    def is_varied(self) -> bool:
        """Whether the setting is `varied`."""
        return self.setting == VARIED

    def prop[P: Prop](self, kind: type[P], name: str) -> P:
        """A thing of the scene with its sizes, by its class and name.

        Raises:
            KeyError: the scene has no such thing.
        """
        for prop in self.props:
            if prop.name == name and isinstance(prop, kind):
                return prop
        raise KeyError(f"the scene has no {kind.__name__} called {name!r}")

    def pose(self, body: str) -> Pose:
        """World pose of a body."""
        index = self.model.body(body).id
        return Pose(self.data.xpos[index], self.data.xquat[index])

    def placed_m(self, body: str) -> NDArray[np.float64]:
        """(3,) where a prop's root body was placed last, world frame; at the world's origin if it never was."""
        return self.data.userdata.reshape(-1, 3)[self.model.body(body).id]

    def has_color(self, geom: str, rgba: tuple[float, ...]) -> bool:
        """Whether a geom has a colour, red, green, blue and opacity from 0 to 1."""
        return bool(np.allclose(self.model.geom(geom).rgba, rgba))

    def speed(self, body: str) -> float:
        """Linear speed of a body's frame, m/s."""
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(
            self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, self.model.body(body).id, velocity, 0
        )
        return float(np.linalg.norm(velocity[3:]))  # after the angular part

    def joint_value(self, joint: str) -> float:
        """Position of a hinge (rad) or slide (m)."""
        return float(self.data.qpos[self.model.joint(joint).qposadr[0]])

    # -- contacts -----------------------------------------------------------------------------------------

    def contacts(self, body_a: str | tuple[str, ...], body_b: str | tuple[str, ...]) -> bool:
        """Whether `body_a`, or one of several, touches `body_b`, or one of several; subtrees are included."""
        a, b = self.geoms(body_a), self.geoms(body_b)
        first, second = self.data.contact.geom.reshape(-1, 2).T
        return bool(np.any((a[first] & b[second]) | (b[first] & a[second])))

    def geoms(self, body: str | tuple[str, ...]) -> NDArray[np.bool_]:
        """Mask (ngeom,) of the geoms on a body, or several, and all bodies below, looked up once."""
        if body not in self._geoms_of:
            self._geoms_of[body] = self.bodies(body)[self.model.geom_bodyid]
        return self._geoms_of[body]

    def bodies(self, body: str | tuple[str, ...]) -> NDArray[np.bool_]:
        """Mask (nbody,) of a body, or several, and all bodies below."""
        in_subtree = np.zeros(self.model.nbody, dtype=bool)
        for name in (body,) if isinstance(body, str) else body:
            in_subtree[self.model.body(name).id] = True
        for child, parent in enumerate(self.model.body_parentid):  # parents come before children
            in_subtree[child] |= in_subtree[parent]
        return in_subtree

    def touching(self, arm: Arm, body: str) -> bool:
        """Whether the hand (palm or fingers) touches a body."""
        return self.contacts(self.arm_pair.hand_body(arm), body)

    def held(self, arm: Arm, body: str) -> bool:
        """Whether a hand grips a body: both fingers touch it, it keeps them apart, and their motor presses them on it."""
        fingers = self.arm_pair.finger_names(arm)
        return self.grips(arm) and all(self.contacts(finger, body) for finger in fingers)

    def grips(self, arm: Arm) -> bool:
        """Whether a hand's motor closes the fingers, and something keeps them apart."""
        is_apart = bool(self.finger_positions(arm).min() > MIN_GRIPPED_M / 2)
        return is_apart and self.squeeze_n(arm) > MIN_SQUEEZE_N

    def squeeze_n(self, arm: Arm) -> float:
        """Force in N with which the motor closes each finger, as of the last step of physics; negative if it opens them."""
        return -float(self.data.actuator_force[self._gripper[arm.ordinal]]) / 2

    def arm_touches(self, arm: Arm, body: str) -> bool:
        """Whether any part of the arm or its hand touches a body."""
        return self.contacts(self.arm_pair.base_body(arm), body)
