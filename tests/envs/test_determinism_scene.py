import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.world.scene import Scene


def start_episode(scene: Scene, seed: int) -> None:
    """Two props that fall, roll and bump into each other, and a coloured target somewhere."""
    rng = np.random.default_rng(seed)
    scene.reset()
    scene.place("ball", Pose.upright((*rng.uniform((0.15, -0.1), (0.3, 0.1)), 0.92)))
    scene.place("item", Pose.upright((*rng.uniform((0.15, -0.1), (0.3, 0.1)), 1.15), rng.uniform(-1, 1)))
    scene.place("target", Pose.upright((*rng.uniform(0.1, 0.3, 2), 0.75)))
    scene.set_color("item", (*rng.uniform(0, 1, 3), 1))
    scene.settle()


def wiggle(scene: Scene, ticks: int, seed: int) -> list[str]:
    """Random but smooth arm motion with the grippers opening and closing; the hash after every tick."""
    rng = np.random.default_rng(seed)
    action = scene.commanded
    joints = [*range(7), *range(8, 15)]
    hashes = []
    for tick in range(ticks):
        action[joints] += rng.uniform(-0.03, 0.03, 14).astype(np.float32)
        action[[7, 15]] = (tick // 4) % 2
        scene.tick(action)
        hashes.append(scene.state_hash())
    return hashes


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene([Ball(), Block(), Target()])


def test_an_unstable_episode_leaves_no_trace(scene):
    start_episode(scene, 3)
    expected = wiggle(scene, 5, 4)
    assert len(set(expected)) == len(expected)
    scene.data.qvel[:] = np.nan
    scene.tick(scene.commanded)
    assert scene.unstable
    start_episode(scene, 3)
    assert wiggle(scene, 5, 4) == expected


def test_a_restored_state_goes_on_exactly_as_the_original(scene):
    start_episode(scene, 5)
    wiggle(scene, 7, 6)
    state, at_save = scene.save_state(), scene.state_hash()
    poses = scene.pose("item").matrix
    original = wiggle(scene, 12, 7)

    start_episode(scene, 8)  # another episode in between
    wiggle(scene, 5, 9)
    scene.restore_state(state)
    assert scene.state_hash() == at_save
    assert scene.ticks == 7
    assert np.array_equal(scene.pose("item").matrix, poses)
    assert wiggle(scene, 12, 7) == original


def test_all_that_a_reset_may_change_and_the_last_bit_of_the_last_command_are_in_the_hash(scene):
    start_episode(scene, 0)
    state, hashes = scene.save_state(), [scene.state_hash()]
    command = scene.commanded
    other = command.copy()
    other[0] = np.nextafter(command[0], np.float32(1))
    for change in (
        lambda: scene.set_color("target", (0, 1, 0, 1)),
        lambda: scene.place("target", Pose.upright((0.3, 0.3, 0.75))),
        lambda: scene.place("item", Pose.upright((0.0, 0.3, 0.80))),
        lambda: scene.tick(command),
        lambda: scene.tick(other),
    ):
        scene.restore_state(state)
        change()
        hashes.append(scene.state_hash())
    assert len(set(hashes)) == len(hashes)
