"""Where pictures are taken from."""

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera
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
