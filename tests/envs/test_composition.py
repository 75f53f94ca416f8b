from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.drawer_cabinet import DrawerCabinet
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.offscreen import Offscreen, release
from lerobot_env_bimanual.world.rendering import QUALITIES, Renderer
from lerobot_env_bimanual.world.scene import Scene

SIZE = 64


class PlainRenderer:
    """Each camera draws every geom, in the model's order, and nothing is kept."""

    def __init__(self, scene: Scene, size: int = SIZE):
        self.model, self.data = scene.model, scene.data
        self.offscreen = Offscreen(self.model, size, size, QUALITIES["observation"])
        self.scene = self.offscreen.make_scene()

    def render(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        self.offscreen.make_current()
        everything = (mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL)
        mujoco.mjv_updateScene(self.model, self.data, *everything, self.scene)
        images = {}
        for name in CAMERA_NAMES:
            pixels = self.offscreen.draw(self.scene, self.data, self.model.camera(name).id)
            depth_m = self.offscreen.depth_m(self.offscreen.centres(pixels.nearness))
            images[name] = self.offscreen.rgb(pixels.rgb), depth_m
        release()
        return images


@contextmanager
def both(scene: Scene, size: int = SIZE) -> Iterator[tuple[Renderer, PlainRenderer]]:
    plain = PlainRenderer(scene, size)
    with Renderer(scene, height=size, width=size) as renderer:
        yield renderer, plain
    plain.offscreen.free()


def assert_same(renderer: Renderer, plain: PlainRenderer) -> None:
    expected = plain.render()
    for camera, (rgb, depth_m) in renderer.render().items():
        assert np.array_equal(rgb, expected[camera][0]), camera
        assert np.array_equal(depth_m, expected[camera][1]), camera


@pytest.fixture
def scene() -> Scene:
    scene = Scene([DrawerCabinet(), Block()])
    scene.place("cabinet", Pose.upright((0.2, 0.25, TABLE_HEIGHT_M)))
    scene.place("item", Pose.upright((0.25, -0.1, TABLE_HEIGHT_M + 0.04)))
    scene.settle(20)
    return scene


def swing(scene: Scene, ticks: int) -> None:
    for _ in range(ticks):
        action = scene.commanded
        action[[0, 8]] += 0.03
        scene.tick(action)


@pytest.mark.parametrize("task", list_tasks())
def test_images_of_every_task_are_those_of_the_whole_scene_drawn_camera_by_camera(task):
    env = BimanualEnv(task, split="val", obs="state")
    env.reset(seed=0)
    with both(env.scene) as (renderer, plain):
        assert_same(renderer, plain)
        swing(env.scene, 5)
        assert_same(renderer, plain)


@pytest.mark.weekly
@pytest.mark.parametrize("task", list_tasks())
def test_images_of_a_whole_episode_are_those_of_the_whole_scene(task):
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    states = []
    env.tick_observers.append(lambda env, _: states.append(env.scene.save_state()))
    run_episode(env, 0, expert())
    with both(env.scene, 256) as (renderer, plain):
        for state in states[::3]:
            env.scene.restore_state(state)
            assert_same(renderer, plain)


CHANGES = {
    "the cabinet stands elsewhere": lambda s: s.place("cabinet", Pose.upright((0.3, 0.2, TABLE_HEIGHT_M))),
    "a sleeping block is carried": lambda scene: scene.place("item", Pose.upright((0.1, -0.2, 1.0))),
    "a drawer is opened": lambda scene: scene.set_joint("cabinet_top_slide", 0.1),
    "the table is painted": lambda scene: scene.set_color("table", (0.2, 0.4, 0.6, 1)),
    "the table lets light through": lambda scene: scene.set_color("table", (0.2, 0.4, 0.6, 0.5)),
    "the block lets light through": lambda scene: scene.set_color("item", (0.2, 0.4, 0.6, 0.5)),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_part_of_the_scene_at_rest_is_drawn_again_when_it_changes(scene, change):
    with both(scene) as (renderer, plain):
        assert_same(renderer, plain)
        change(scene)
        assert_same(renderer, plain)


def test_equally_near_things_are_seen_in_the_model_s_order(scene):
    with both(scene) as (renderer, plain):
        scene.model.geom_rgba[scene.model.geom("item").id] = (0, 1, 0, 1)
        half = scene.model.geom("item").size
        scene.model.geom("table").size[:] = half  # as large as the block, and in the same place
        scene.place("item", Pose.upright(scene.model.geom("table").pos))
        assert_same(renderer, plain)
