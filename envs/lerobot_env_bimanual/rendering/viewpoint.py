"""The part of a camera's view that an episode is in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_env_bimanual.world.scene import Scene, SceneState

MOVED_M = 0.002
"""Way along an axis from which on an object counts as moved: less than that of a button."""
ROOM_M = 0.16
"""Around hands and things that a frame leaves."""

type Frame = dict[str, NDArray[np.float64]]
"""Fields of a model that turn and zoom a camera, as `Appearance` wears them."""


def frame_of(scene: Scene, camera: str, states: Sequence[SceneState], size: tuple[int, int]) -> Frame:
    """Turn and zoom of a fixed camera with which it shows hands and moved objects as large as the image allows.

    Args:
        scene: the scene; it is left in the last state.
        camera: name of the camera, which is left where it is.
        states: moments of the episode, from its start on.
        size: height and width of the image, pixels.
    """
    model, index = scene.model, scene.model.camera(camera).id
    places_m = np.empty((len(states), model.nbody, 3))
    for state, places in zip(states, places_m, strict=True):
        scene.restore_state(state)
        places[:] = scene.data.xipos
    is_hand = np.any([scene.bodies(scene.arm_pair.hand_body(arm)) for arm in ARMS], axis=0)
    # The hands come from far above.
    things_m, hands_m = places_m[:, _moved(places_m) & (scene.arm_of_body < 0)], places_m[1:, is_hand]
    points_m = np.concatenate([things_m.reshape(-1, 3), hands_m.reshape(-1, 3)])
    eye, half = scene.data.cam_xpos[index], np.tan(np.deg2rad(model.cam_fovy[index]) / 2)
    axes, sides = scene.data.cam_xmat[index].reshape(3, 3), []
    for _ in range(3):  # where the middle of what is seen moves to the middle of the image
        right, up, back = ((points_m - eye) @ axes).T
        room = ROOM_M / -back
        sides = [(np.min(way / -back - room), np.max(way / -back + room)) for way in (right, up)]
        axes = _towards(axes @ np.array([*np.mean(sides, axis=1), -1.0]))
    wide, high = np.ptp(sides, axis=1) / 2
    fovy, quat_wxyz = model.cam_fovy.copy(), model.cam_quat.copy()
    fovy[index] = 2 * np.rad2deg(np.arctan(min(half, max(high, wide * size[0] / size[1]))))
    quat_wxyz[index] = matrix_to_quat_wxyz(axes)
    return {"cam_fovy": fovy, "cam_quat": quat_wxyz}


def _towards(ahead: NDArray) -> NDArray:
    """(3, 3) axes of a camera, in MuJoCo's order, that looks in a direction with its right side level."""
    back = -ahead / np.linalg.norm(ahead)
    right = np.cross((0, 0, 1), back)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(back, right), back])


def _moved(places_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(nbody,) bodies that are not always in one place, from their places (n, nbody, 3)."""
    return np.ptp(places_m, axis=0).max(axis=1) > MOVED_M
