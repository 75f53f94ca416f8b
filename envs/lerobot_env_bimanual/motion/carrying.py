"""Props that move rigidly with a hand, for motions that are computed without physics."""

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.scene_view import SceneView


class Carried:
    """A free prop fixed to a hand at the relative pose that both have in `data` now.

    Raises:
        ValueError: the prop is not free, such as a drawer; those do not move with a hand here.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, hand: str, prop: str):
        self.body = model.body(prop).id
        if not is_free(model, self.body):
            raise ValueError(f"{prop!r} has no free joint, so it cannot be carried by {hand!r}")
        self._hand = model.body(hand).id
        address = model.jnt_qposadr[model.body_jntadr[self.body]]
        self._position = slice(address, address + 3)
        self._quaternion = slice(address + 3, address + 7)
        # hand_T_prop = inverse(world_T_hand) @ world_T_prop, each a position and a quaternion.
        to_hand, self._in_hand = ((np.empty(3), np.empty(4)) for _ in range(2))
        mujoco.mju_negPose(*to_hand, data.xpos[self._hand], data.xquat[self._hand])
        mujoco.mju_mulPose(*self._in_hand, *to_hand, data.xpos[self.body], data.xquat[self.body])

    def follow(self, data: mujoco.MjData) -> None:
        """Put the prop where the hand of `data` carries it; the caller then recomputes the kinematics."""
        position, quaternion = data.qpos[self._position], data.qpos[self._quaternion]  # views
        mujoco.mju_mulPose(
            position, quaternion, data.xpos[self._hand], data.xquat[self._hand], *self._in_hand
        )


def is_free(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body hangs on nothing but its own free joint."""
    joint = model.body_jntadr[body]
    return bool(joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)


def props_in_hands(scene: SceneView) -> list[tuple[Arm, str]]:
    """The free props that both fingers of a hand touch now; the first hand has a prop that both hold."""
    model, held = scene.model, {}
    for arm in reversed(ARMS):
        for body in _touched_by_both_fingers(scene, arm):
            if is_free(model, body):
                held[model.body(body).name] = arm
    return [(arm, prop) for prop, arm in sorted(held.items())]


def _touched_by_both_fingers(scene: SceneView, arm: Arm) -> set[int]:
    """Root bodies of everything that touches both fingers."""
    model = scene.model
    bodies = model.geom_bodyid[scene.data.contact.geom.reshape(-1, 2)]
    fingers = (bodies == model.body(finger).id for finger in scene.arm_pair.finger_names(arm))
    touched = (model.body_rootid[bodies[is_finger[:, ::-1]]] for is_finger in fingers)
    return set.intersection(*(set(roots.tolist()) for roots in touched))
