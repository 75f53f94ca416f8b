"""Collision checks of postures, on a private copy of the scene.

The checker has its own model (arms grown by the clearance) and its own data, so that checking never touches
the scene's state, and the same scene always gives the same answer.
"""

import copy
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import Carried
from lerobot_env_bimanual.world.scene import RESETTABLE_FIELDS, Scene

Array = NDArray[np.floating]

CLEARANCE_M = 0.015
"""Distance that an arm in free motion keeps from everything but itself (design study)."""
NEVER = -np.inf


class CollisionChecker:
    """Answers whether two postures are free of collisions under the rules of the motion at hand.

    Begin with `begin_free_motion`, `begin_contact_motion` or `begin_standing`, then ask any number of times.

    Args:
        scene: The world; its positions are read at the start of each motion.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        self._model = copy.copy(scene.model)
        self._data = mujoco.MjData(self._model)
        self._owner = _owners(scene)
        # Both, as MuJoCo discards pairs of bodies before it looks at their geoms.
        self._model.body_margin[self._owner >= 0] = CLEARANCE_M
        self._model.geom_margin[self._owner[self._model.geom_bodyid] >= 0] = CLEARANCE_M
        self._joints = [
            np.array([self._model.joint(name).qposadr[0] for name in scene.arm_pair.joint_names(arm)])
            for arm in ARMS
        ]
        self._carried: list[Carried] = []
        self._least_distance = np.full((self._model.nbody, self._model.nbody), NEVER)
        self._is_finger = np.zeros(self._model.nbody, dtype=bool)
        for arm in ARMS:
            self._is_finger[[self._model.body(name).id for name in scene.arm_pair.finger_names(arm)]] = True
        self._contact_rules = self._make_contact_rules()
        self._standing_rules = self._make_standing_rules()

    def begin_free_motion(
        self, checked: Iterable[Arm], carried: Iterable[tuple[Arm, str]], left: Array, right: Array
    ) -> None:
        """Rules of a motion through free space: clearance from everything, no self-collision.

        Bodies that are too close already at the start may stay so: a hand has to get away from what it touches.

        Args:
            checked: The arms whose collisions count; the other arm is only an obstacle.
            carried: Hand and prop, for all props that move with a hand.
            left: (7,) rad, commanded joints at the start. (Under load the arm itself lags behind them.)
            right: (7,) rad.
        """
        self._copy_state()
        owner = self._owner.copy()
        self._carried = []
        for arm, prop in carried:
            hand = self._scene.arm_pair.hand_body(arm)
            self._carried.append(Carried(self._model, self._data, hand, prop))
            owner[self._model.body_rootid == self._carried[-1].body] = arm.ordinal
        is_arm = self._owner >= 0
        self._least_distance[:] = NEVER
        for arm in checked:
            mine = owner == arm.ordinal
            self._require(mine & is_arm, ~mine, CLEARANCE_M)
            self._require(mine & ~is_arm, ~mine, 0.0)
            self._require(mine, mine, 0.0)
        mujoco.mj_collision(self._model, self._data)
        self._allow(self._offending())
        self._move(left, right)
        self._allow(self._offending())

    def begin_contact_motion(self) -> None:
        """Rules of a motion into contact: an arm may touch props, not itself, the table or the other arm.

        Fingers of the two hands may overlap: without physics it is unknown how far they are closed.
        """
        self._copy_state()
        self._carried = []
        self._least_distance[:] = self._contact_rules

    def begin_standing(self) -> None:
        """Rules for arms that stand still: clearance from all props, as a motion cannot begin within them."""
        self._copy_state()
        self._carried = []
        self._least_distance[:] = self._standing_rules

    def free(self, left: Array, right: Array) -> bool:
        """Whether the two postures, (7,) rad each, keep the rules."""
        self._move(left, right)
        return self._data.ncon == 0 or not len(self._offending())

    def obstacle(self, left: Array, right: Array) -> str | None:
        """What is in the way of the two postures, e.g. `left_link6 and oven`; None if they are free."""
        self._move(left, right)
        offending = self._offending()
        if not len(offending):
            return None
        return " and ".join(self._model.body(body).name for body in offending[0])

    def _make_contact_rules(self) -> Array:
        """Least distance of each pair of bodies in a motion into contact, (nbody, nbody)."""
        self._least_distance[:] = NEVER
        left, right = (self._owner == arm.ordinal for arm in ARMS)
        self._require(left, left, 0.0)
        self._require(right, right, 0.0)
        self._require(left & ~self._is_finger, right & ~self._is_finger, 0.0)
        world = np.arange(self._model.nbody) == 0
        self._require(left | right, world, 0.0)
        return self._least_distance.copy()

    def _make_standing_rules(self) -> Array:
        """Least distance of each pair of bodies while the arms stand still, (nbody, nbody)."""
        self._least_distance[:] = NEVER
        is_arm = self._owner >= 0
        is_prop = ~is_arm & (np.arange(self._model.nbody) > 0)
        self._require(is_arm, is_prop, CLEARANCE_M)
        return self._least_distance.copy()

    def _copy_state(self) -> None:
        for field in RESETTABLE_FIELDS:
            getattr(self._model, field)[:] = getattr(self._scene.model, field)
        self._data.qpos[:] = self._scene.data.qpos
        mujoco.mj_kinematics(self._model, self._data)

    def _move(self, left: Array, right: Array) -> None:
        model, data = self._model, self._data
        data.qpos[self._joints[0]] = left
        data.qpos[self._joints[1]] = right
        mujoco.mj_kinematics(model, data)
        if self._carried:
            for carried in self._carried:
                carried.follow(data)
            mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)

    def _require(self, a: NDArray[np.bool_], b: NDArray[np.bool_], distance_m: float) -> None:
        """Bodies of mask `a` keep a distance from bodies of mask `b`; the larger of two demands holds."""
        demanded = np.where(np.outer(a, b) | np.outer(b, a), distance_m, NEVER)
        np.maximum(self._least_distance, demanded, out=self._least_distance)

    def _allow(self, pairs: NDArray[np.int32]) -> None:
        self._least_distance[pairs[:, 0], pairs[:, 1]] = NEVER
        self._least_distance[pairs[:, 1], pairs[:, 0]] = NEVER

    def _offending(self) -> NDArray[np.int32]:
        """Pairs of bodies (n, 2) that are closer than they may be."""
        contact = self._data.contact
        bodies = self._model.geom_bodyid[contact.geom.reshape(-1, 2)]
        return bodies[contact.dist < self._least_distance[bodies[:, 0], bodies[:, 1]]]


def _owners(scene: Scene) -> NDArray[np.int64]:
    """Index of the arm that each body belongs to, (nbody,); -1 for world and props."""
    owner = np.full(scene.model.nbody, -1)
    for arm in ARMS:
        base = scene.model.body(scene.arm_pair.base_body(arm)).id
        owner[scene.model.body_rootid == base] = arm.ordinal
    return owner
