"""Things at rest sleep, which saves time and must change nothing else."""

from itertools import product

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S


def sleepers(scene: Scene) -> int:
    return int((scene.data.tree_asleep >= 0).sum())


def test_a_thing_at_rest_sleeps_until_a_reset_and_the_arms_never_do():
    scene = Scene([Block()])
    scene.place("item", Pose.upright((0.25, 0.1, 0.79)))
    scene.settle(20)
    assert sleepers(scene) == 1
    assert scene.speed("item") == 0
    assert list(scene.data.tree_asleep[:2] < 0) == [True, True]
    scene.reset()
    assert sleepers(scene) == 0
    scene.place("item", Pose.upright((0.1, -0.2, 0.9)))
    assert scene.pose("item").position == pytest.approx((0.1, -0.2, 0.9))


def test_a_rope_is_laid_down_at_rest_and_sleeps_after_a_tick():
    env = BimanualEnv("straighten_rope", split="val", obs="state")
    env.reset(seed=0)
    scene, ends_m = env.scene, [env.scene.pose(body).position for body in ("rope", "rope_17")]
    assert sleepers(scene) == 1
    assert scene.data.time == pytest.approx(TICK_S)  # of settling
    env.step(scene.commanded)
    assert np.allclose([scene.pose(body).position for body in ("rope", "rope_17")], ends_m, atol=1e-6)
    env.close()


@pytest.mark.sim
@pytest.mark.parametrize("name", list_tasks())
def test_an_episode_goes_on_bit_for_bit_from_states_with_and_without_sleepers(name):
    env = BimanualEnv(name, split="val", obs="state")
    states, actions, hashes, slept = [], [], [], []

    def note(env, action):
        states.append(env.scene.save_state())
        actions.append(action.copy())
        hashes.append(env.scene.state_hash())
        slept.append(sleepers(env.scene))
        # A touch wakes: no hand touches what sleeps.
        for arm, tree in product(Arm, np.flatnonzero(env.scene.data.tree_asleep >= 0)):
            body = env.scene.model.body(env.scene.model.tree_bodyadr[tree]).name
            assert not env.scene.touching(arm, body)

    env.tick_observers.append(note)
    assert run_episode(env, 3, expert()).success
    assert any(slept)
    other = Scene(env.task_definition.spec.props)
    changes = np.flatnonzero(np.diff(slept)).tolist()  # something falls asleep or wakes
    for start in {0, *changes[:6], len(states) // 2}:
        other.restore_state(states[start])
        assert other.state_hash() == hashes[start]
        for tick in range(start, min(start + 8, len(states) - 1)):
            other.tick(actions[tick])
            assert other.state_hash() == hashes[tick + 1], (start, tick)
    env.close()
