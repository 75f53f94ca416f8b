"""Collision checks of postures, on a private copy of the scene.

The checker has its own model (arms grown by the clearance) and its own data, so that checking never touches
the scene's state, and the same scene always gives the same answer. The rules of a motion are values.
"""

import copy
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import Carried
from lerobot_env_bimanual.world.scene import RESETTABLE_FIELDS
from lerobot_env_bimanual.world.scene_view import SceneView

Array = NDArray[np.floating]
type Bodies = NDArray[np.bool_]
"""(nbody,) some of a model's bodies."""

CLEARANCE_M = 0.015
"""Distance that an arm in free motion keeps from everything but itself."""
NO_MIN_DISTANCE = -np.inf


@dataclass(frozen=True, eq=False)
class CollisionRules:
    """What two postures must keep away from.

    Attributes:
        least_distance_m: (nbody, nbody) of each pair of bodies; minus infinity where any distance is allowed.
        carried: props that move with a hand.
    """

    least_distance_m: Array
    carried: tuple[Carried, ...] = ()


class CollisionChecker:
    """Answers whether two postures are free of collisions under the rules of the motion at hand.

    Args:
        scene: the world; its positions are read by `update_from_scene`.

    Attributes:
        contact_rules: of a motion into contact: forearms and hands may touch props, but no arm may touch itself, the table
            or the other arm. Fingers of the two hands may overlap: without physics it is unknown how far they are closed.
        standing_rules: of arms at rest: clearance from all props, since a motion cannot begin closer to one.
    """

    def __init__(self, scene: SceneView):
        self._scene = scene
        self._model = copy.copy(scene.model)
        self._data = mujoco.MjData(self._model)
        self._owner = scene.arm_of_body
        is_arm = self._owner >= 0
        # Both, as MuJoCo discards pairs of bodies before it looks at their geoms.
        self._model.body_margin[is_arm] = CLEARANCE_M
        self._model.geom_margin[is_arm[self._model.geom_bodyid]] = CLEARANCE_M
        self._joints = scene.joint_qpos
        self.contact_rules = self._make_contact_rules()
        is_prop = ~is_arm & (np.arange(self._model.nbody) > 0)
        self.standing_rules = CollisionRules(self._least((is_arm, is_prop, CLEARANCE_M)))

    def update_from_scene(self) -> None:
        """Take over where everything in the scene is now."""
        for field in RESETTABLE_FIELDS:
            getattr(self._model, field)[:] = getattr(self._scene.model, field)
        self._data.qpos[:] = self._scene.data.qpos
        mujoco.mj_kinematics(self._model, self._data)

    def free_motion_rules(
        self, checked: Iterable[Arm], carried: Iterable[tuple[Arm, str]], left: Array, right: Array
    ) -> CollisionRules:
        """Rules of a motion through free space from where everything was at the last `update_from_scene`.

        Clearance from everything, no self-collision. Bodies that are too close already at the start may stay so: a
        hand has to get away from what it touches.

        Args:
            checked: the arms whose collisions count; the other arm is only an obstacle.
            carried: hand and prop, for all props that move with a hand.
            left: (7,) rad, commanded joints at the start. (Under load the arm itself lags behind them.)
            right: (7,) rad.
        """
        owner = self._owner.copy()
        props = []
        for arm, prop in carried:
            hand = self._scene.arm_pair.hand_body(arm)
            props.append(Carried(self._model, self._data, hand, prop))
            owner[self._model.body_rootid == props[-1].body] = arm.ordinal
        is_arm, demands = self._owner >= 0, []
        for arm in checked:
            mine = owner == arm.ordinal
            demands += [(mine & is_arm, ~mine, CLEARANCE_M), (mine & ~is_arm, ~mine, 0.0), (mine, mine, 0.0)]
        least = self._least(*demands)
        rules = CollisionRules(least, tuple(props))
        mujoco.mj_collision(self._model, self._data)
        _allow(least, self._offending(rules))
        self._move(rules, left, right)
        _allow(least, self._offending(rules))
        return rules

    def is_free(self, rules: CollisionRules, left: Array, right: Array) -> bool:
        """Whether the two postures, (7,) rad each, keep the rules."""
        self._move(rules, left, right)
        return self._data.ncon == 0 or not len(self._offending(rules))

    def obstacle(self, rules: CollisionRules, left: Array, right: Array) -> str | None:
        """What is in the way of the two postures, e.g. `left_link6 and oven`; None if they are free."""
        self._move(rules, left, right)
        offending = self._offending(rules)
        if not len(offending):
            return None
        return " and ".join(self._model.body(body).name for body in offending[0])

    def _make_contact_rules(self) -> CollisionRules:
        pair, every = self._scene.arm_pair, np.arange(self._model.nbody)
        is_finger, is_upper = (
            np.isin(every, [self._model.body(name).id for arm in ARMS for name in names(arm)])
            for names in (pair.finger_names, pair.upper_links)
        )
        left, right = (self._owner == arm.ordinal for arm in ARMS)
        touchless = [
            (left, left),
            (right, right),
            (left & ~is_finger, right & ~is_finger),
            (left | right, every == 0),
            (is_upper, ~(left | right)),
        ]
        return CollisionRules(self._least(*((*masks, 0.0) for masks in touchless)))

    def _least(self, *demands: tuple[Bodies, Bodies, float]) -> Array:
        """Distances (nbody, nbody) that bodies of two masks keep from each other; the largest of several demands holds."""
        least = np.full((self._model.nbody, self._model.nbody), NO_MIN_DISTANCE)
        for a, b, distance_m in demands:
            np.maximum(
                least, np.where(np.outer(a, b) | np.outer(b, a), distance_m, NO_MIN_DISTANCE), out=least
            )
        return least

    def _move(self, rules: CollisionRules, left: Array, right: Array) -> None:
        model, data = self._model, self._data
        data.qpos[self._joints[0]] = left
        data.qpos[self._joints[1]] = right
        mujoco.mj_kinematics(model, data)
        if rules.carried:
            for carried in rules.carried:
                carried.follow(data)
            mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)

    def _offending(self, rules: CollisionRules) -> NDArray[np.int32]:
        """Pairs of bodies (n, 2) that are closer than they may be."""
        contact = self._data.contact
        bodies = self._model.geom_bodyid[contact.geom.reshape(-1, 2)]
        return bodies[contact.dist < rules.least_distance_m[bodies[:, 0], bodies[:, 1]]]


def _allow(least: Array, pairs: NDArray[np.int32]) -> None:
    """Pairs of bodies (n, 2) may be as close as they like."""
    least[pairs[:, 0], pairs[:, 1]] = NO_MIN_DISTANCE
    least[pairs[:, 1], pairs[:, 0]] = NO_MIN_DISTANCE
