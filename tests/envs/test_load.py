"""Load metrics and other measurements of experts' episodes: without a trace, true of known motions, and within limits."""

import numpy as np
import pytest
from sample_results import LIGHT

from lerobot_bimanual.results.episode import LoadMetrics
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts import load as load_module
from lerobot_env_bimanual.experts.load import BOUNDS, LoadMeter, excesses, keyframes_found, run_measured
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contact_forces import felt
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import STEPS_PER_TICK, TICK_S

SEED = 3
LIMITS = PANDA_PAIR.joint_limits


@pytest.fixture(scope="module")
def env():
    env = BimanualEnv("lift_ball", split="val", obs="state")
    yield env
    env.close()


@pytest.mark.sim
@pytest.mark.parametrize("mode", ["none", "joint", "keypose"])
def test_measuring_leaves_an_episode_as_it_is_and_its_replay_goes_through_the_same_states(env, mode):
    found = run_measured(env, SEED, expert(), mode)
    assert not env.tick_observers
    assert not env.step_observers
    assert found.keyframes_found
    assert found.replayed is (None if mode == "none" else True)
    unmeasured = found.model_copy(update={"load": None, "keyframes_found": None, "replayed": None})
    assert unmeasured == run_episode(env, SEED, expert())  # the hash of the last state among all else


@pytest.mark.sim
def test_a_replay_of_other_actions_is_reported(env, monkeypatch):
    def changed(env, seed, variation, actions, hashes):
        return replay(env, seed, variation, [actions[0] + np.float32(1e-6), *actions[1:]], hashes)

    replay = load_module.replay
    monkeypatch.setattr(load_module, "replay", changed)
    assert run_measured(env, SEED, expert(), "keypose").replayed is False


@pytest.mark.sim
def test_keyframes_at_other_ticks_are_reported(env):
    actions = []
    with env.observed_by(lambda _, action: actions.append(action.copy())):
        ticks = [move.ticks for move in run_episode(env, SEED, expert()).moves]
    assert keyframes_found(np.array(actions), ticks)
    assert not keyframes_found(np.array(actions), [ticks[0] + 5, ticks[1] - 5, *ticks[2:]])


def test_arms_that_hold_still_touch_nothing_and_carry_their_own_weight():
    scene = Scene()
    meter = LoadMeter(scene)
    for _ in range(2):
        meter.observe_tick(scene.commanded)
        scene.tick(scene.commanded, [meter.observe_step])
    load = meter.result()
    assert (load.velocity, load.acceleration, load.jerk, load.contact_force_n) == (0, 0, 0, 0)
    assert (load.penetration_mm, load.penetrating) == (0, "")
    assert load.torque > 0.1  # joint 2 holds up an arm that reaches out
    assert load.finger_speed_m_s == pytest.approx(0, abs=1e-3)


def test_commands_are_differentiated_over_ticks():
    scene = Scene()
    meter = LoadMeter(scene)
    action, speed_rad_s = scene.commanded, 0.5
    for _ in range(4):  # as if joint 1 of the left arm started at once
        action[0] += speed_rad_s * TICK_S
        meter.observe_tick(action)
    meter.observe_step()
    load = meter.result()
    acceleration_rad_s2 = speed_rad_s / TICK_S
    expected = (
        (load.velocity, speed_rad_s / LIMITS.velocity_rad_s[0]),
        (load.acceleration, acceleration_rad_s2 / LIMITS.acceleration_rad_s2[0]),
        (load.jerk, acceleration_rad_s2 / PHYSICS_STEP_S / LIMITS.jerk_rad_s3[0]),
    )
    for found, value in expected:
        assert found == pytest.approx(value, rel=1e-3)


def test_a_force_is_felt_in_full_if_it_lasts_and_faintly_if_it_is_a_knock():
    lasting, knock = np.zeros((2, 10 * STEPS_PER_TICK, 2, 3))
    lasting[:, 0, 2] = 50.0
    knock[7, 0, 2] = 50.0
    assert felt(lasting).max() == pytest.approx(50.0, rel=1e-3)
    assert 5.0 < felt(knock).max() < 7.0


def test_every_number_has_a_bound_and_what_is_beyond_it_is_named():
    assert list(excesses("lift_ball", LIGHT)) == []
    heavy = LoadMetrics(**dict.fromkeys(BOUNDS, 1000.0), penetrating="pad, cube")
    found = dict(excesses("lift_ball", heavy))
    assert [*found] == [*BOUNDS]
    assert found["penetration_mm"] == "penetration_mm is 1e+03 (pad, cube), but must be at most 2"
