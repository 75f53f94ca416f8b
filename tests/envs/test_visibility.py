"""What the cameras see of the objects and of what each arm goes to."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.pictures.visibility import (
    IMAGE_SIZE,
    MIN_PIXELS,
    MIN_VIEWS,
    Moment,
    TargetViews,
    find_targets,
    look,
    sights,
)
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.reports.visibility import Visibility, pixels_table, targets_table
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene, SceneState

DOWN = np.array([0.0, 1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene([Block(), Box()])


@pytest.fixture(scope="module")
def renderer(scene):
    with Renderer(scene, CAMERA_NAMES, IMAGE_SIZE, IMAGE_SIZE) as renderer:
        yield renderer


def reaching(
    scene: Scene, block_m: tuple[float, float, float], box_m: tuple[float, float, float]
) -> list[SceneState]:
    """States before and after the left hand has gone from home to 8 cm above a block, beside a box."""
    scene.reset()
    scene.place("item", Pose.upright(block_m))
    scene.place("box", Pose.upright(box_m))
    before = scene.save_state()
    kinematics = scene.arm_pair.kinematics[Arm.LEFT]
    above = Pose(np.array(block_m), DOWN).translated((0, 0, 0.08))
    joints = kinematics.ik(above.matrix)[0]
    for joint, value in zip(scene.arm_pair.joint_names(Arm.LEFT), joints, strict=True):
        scene.set_joint(joint, value)
    return [before, scene.save_state()]


def test_the_target_is_what_the_hand_is_next_to_when_it_arrives(scene):
    targets = find_targets(scene, *reaching(scene, (0.15, 0.1, 0.78), (0.45, -0.3, 0.85)))
    assert set(targets) == {Arm.LEFT}  # the right arm has not moved
    top_m = (0.15, 0.1, 0.78)
    assert np.linalg.norm(targets[Arm.LEFT].point_m - top_m) < 0.05


@pytest.mark.parametrize("camera", FIXED_CAMERAS, ids=lambda camera: camera.name)
def test_a_wall_hides_the_target_from_the_camera_behind_it_only(scene, renderer, camera):
    block_m = np.array([0.15, 0.1, 0.78])
    towards = np.array(camera.position) - block_m
    wall_m = block_m + 0.45 * towards / np.linalg.norm(towards)
    seen = {}
    for name, box_m in (("open", (0.9, 0.9, 0.2)), ("walled", wall_m)):
        targets = find_targets(scene, *reaching(scene, tuple(block_m), tuple(box_m)))
        items, aimed = look(scene, renderer, targets)
        item, pixels = aimed[Arm.LEFT]
        assert item == "item"
        assert np.array_equal(pixels, items["item"])  # all of so small a thing is near where the hand goes
        seen[name] = pixels >= MIN_PIXELS
    index = CAMERA_NAMES.index(camera.name)
    assert seen["open"][index]
    assert np.array_equal(seen["open"] != seen["walled"], np.arange(len(CAMERA_NAMES)) == index)


def test_segmentation_shows_every_geom_where_the_picture_does(scene, renderer):
    reaching(scene, (0.15, 0.1, 0.78), (0.45, -0.3, 0.85))
    images, segments = renderer.render(), renderer.segment()
    is_item = scene.model.geom_bodyid == scene.model.body("item").id
    found = 0
    for camera in CAMERA_NAMES:
        (rgb, depth_m), (geoms, depth_too_m) = images[camera], segments[camera]
        assert np.mean(depth_m[geoms >= 0] == depth_too_m[geoms >= 0]) > 0.99
        red, green, blue = rgb.astype(int).transpose(2, 0, 1)
        shown = geoms[(red > 90) & (green < 30) & (blue < 30)]
        assert np.all(shown >= 0)
        assert np.count_nonzero(is_item[shown]) >= 0.95 * len(shown)
        found += len(shown)
    assert found > 200


def test_a_stored_measurement_is_read_as_it_was_written_and_a_damaged_one_is_refused(tmp_path):
    views = TargetViews(("ball",), least_views=3, seen=2, episodes=2)
    moment = Moment(0, "beside", {"ball": (1, 2, 3, 4, 5)}, {"left": views})
    visibility = Visibility("test", "0:2", {"lift_ball": "abc"}, {"lift_ball": (moment,)})
    path = tmp_path / "visibility.json"
    path.write_text(json.dumps(asdict(visibility)))
    assert Visibility.read(path) == visibility
    assert "| `lift_ball` | 2 | 100.0% | 3 | ball | 1. beside (left) |" in str(targets_table(visibility))
    assert "| `lift_ball` | ball | 1 / 1 | 2 / 2 |" in pixels_table(visibility)
    path.write_text(path.read_text().replace("[1, 2, 3, 4, 5]", "[1, 2]"))
    with pytest.raises(BimanualError, match="5 pixels per object"):
        Visibility.read(path)


@pytest.mark.slow
@pytest.mark.parametrize("task", list_tasks())
def test_before_every_move_two_cameras_see_what_each_arm_goes_to(task):
    views = [sight.views(arm) for sight in sights(task, range(4), "val") for arm in sight.targets]
    assert min(views) >= MIN_VIEWS
