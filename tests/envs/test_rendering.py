"""Where pictures are taken from."""

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera, frame_of
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.scene import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene([Block(), Box()])


@pytest.mark.parametrize("camera", FIXED_CAMERAS, ids=lambda camera: camera.name)
def test_the_clearest_camera_is_one_that_the_moved_thing_is_not_hidden_from(scene, camera):
    block_m = np.array([0.27, 0.05, 0.80])
    wall_m = block_m + 0.3 * (np.array(camera.position) - block_m) / np.linalg.norm(camera.position - block_m)
    states = []
    for move_m in (-0.03, 0.03):
        scene.reset()
        scene.place("box", Pose.upright(wall_m, np.arctan2(*(wall_m - block_m)[:2])))
        scene.place("item", Pose.upright(block_m + np.array([move_m, 0, 0])))
        states.append(scene.save_state())
    assert clearest_camera(scene, states) != camera.name


@pytest.mark.parametrize("camera", FIXED_CAMERAS, ids=lambda camera: camera.name)
def test_a_frame_holds_what_moves_and_shows_it_larger(scene, camera):
    states = []
    for x_m in (0.1, 0.3):
        scene.reset()
        scene.place("item", Pose.upright((x_m, 0.05, 0.80)))
        scene.pose_arms(np.tile([0.0, 0.4, 0.0, -2.0, 0.0, 2.4, 0.8], (2, 1)))  # hands above the table
        states.append(scene.save_state())
    height, width = 480, 640
    frame = frame_of(scene, camera.name, states, (height, width))
    index = scene.model.camera(camera.name).id
    assert frame["cam_fovy"][index] < 0.9 * camera.fovy_deg
    with applied(scene.model, scene.data, frame):
        axes, eye = scene.data.cam_xmat[index].reshape(3, 3), scene.data.cam_xpos[index].copy()
    half = np.tan(np.deg2rad(frame["cam_fovy"][index]) / 2)
    for state in states:
        scene.restore_state(state)
        right, up, back = (scene.pose("item").position - eye) @ axes
        assert abs(up / back) < half
        assert abs(right / back) < half * width / height
