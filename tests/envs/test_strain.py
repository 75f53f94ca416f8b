"""What episodes ask of the arms: measured without a trace, true of known motions, and within the real arms' limits."""

from dataclasses import astuple, replace

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.evidence import EvidenceRecorder
from lerobot_env_bimanual.experts.outcome import Outcome
from lerobot_env_bimanual.experts.runner import run_expert
from lerobot_env_bimanual.experts.strain import BOUNDS, Strain, StrainMeter, excesses, felt, peak_strain
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import STEPS_PER_TICK, TICK_S

SEED = 3
LIMITS = PANDA_PAIR.joint_limits
LIGHT = Strain(0.5, 0.0, 0.5, 0.5, 0.5, 5.0, 0.05, 0.5, "hand, box")


def measured(env: BimanualEnv) -> tuple[Outcome, Strain]:
    recorder = EvidenceRecorder(env)
    with env.observed_by(recorder.note, recorder.note_step):
        outcome = run_expert(env, SEED)
    return outcome, recorder.evidence([], [], "none").strain


@pytest.mark.sim
def test_measuring_leaves_an_episode_as_it_is():
    env = BimanualEnv("lift_ball", split="val", obs="state")
    assert measured(env)[0] == run_expert(env, SEED)  # the hash of the last state among all else
    env.close()


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("task", list_tasks())
def test_an_expert_asks_for_no_more_than_the_real_arm_gives(task):
    env = BimanualEnv(task, split="val", obs="state")
    outcome, strain = measured(env)
    env.close()
    assert outcome.success
    assert list(excesses(task, strain)) == []


def test_the_motors_of_the_model_are_as_strong_as_the_real_ones():
    model = Scene().model
    joints = [model.joint(name) for arm in ARMS for name in PANDA_PAIR.joint_names(arm)]
    for joint, torque_nm in zip(joints, np.tile(LIMITS.torque_nm, 2), strict=True):
        assert model.jnt_actgravcomp[joint.id]  # or the weight of the arm would not count
        assert model.jnt_actfrcrange[joint.id] == pytest.approx([-torque_nm, torque_nm])


def test_arms_that_hold_still_touch_nothing_and_carry_their_own_weight():
    scene = Scene()
    meter = StrainMeter(scene)
    for _ in range(2):
        meter.observe_tick(scene.commanded)
        scene.tick(scene.commanded, [meter.observe_step])
    strain = meter.result()
    assert (strain.velocity, strain.acceleration, strain.jerk, strain.contact_force_n) == (0, 0, 0, 0)
    assert (strain.penetration_mm, strain.penetrating) == (0, "")
    assert strain.torque > 0.1  # joint 2 holds up an arm that reaches out
    assert strain.finger_speed_m_s == pytest.approx(0, abs=1e-3)


def test_commands_are_differentiated_over_ticks():
    scene = Scene()
    meter = StrainMeter(scene)
    action, speed_rad_s = scene.commanded, 0.5
    for _ in range(4):  # as if joint 1 of the left arm started at once
        action[0] += speed_rad_s * TICK_S
        meter.observe_tick(action)
    meter.observe_step()
    strain = meter.result()
    assert strain.velocity == pytest.approx(speed_rad_s / LIMITS.velocity_rad_s[0], rel=1e-3)
    assert strain.acceleration == pytest.approx(
        speed_rad_s / TICK_S / LIMITS.acceleration_rad_s2[0], rel=1e-3
    )
    assert strain.jerk == pytest.approx(
        speed_rad_s / TICK_S / PHYSICS_STEP_S / LIMITS.jerk_rad_s3[0], rel=1e-3
    )


def test_a_force_is_felt_in_full_if_it_lasts_and_faintly_if_it_is_a_knock():
    lasting, knock = np.zeros((2, 10 * STEPS_PER_TICK, 2, 3))
    lasting[:, 0, 2] = 50.0
    knock[7, 0, 2] = 50.0
    assert felt(lasting).max() == pytest.approx(50.0, rel=1e-3)
    assert 5.0 < felt(knock).max() < 7.0


def test_peaks_are_taken_number_by_number_and_name_the_deepest_pair():
    deep = replace(LIGHT, torque=0.1, penetration_mm=1.0, penetrating="pad, cube")
    assert peak_strain([LIGHT, deep]) == replace(LIGHT, penetration_mm=1.0, penetrating="pad, cube")


def test_every_number_has_a_bound_and_what_is_beyond_it_is_named():
    assert list(excesses("lift_ball", LIGHT)) == []
    heavy = Strain(*[1000.0] * (len(astuple(LIGHT)) - 1), penetrating="pad, cube")
    assert [name for name, _ in excesses("lift_ball", heavy)] == list(BOUNDS)
    assert (
        "penetration_mm is 1e+03 (pad, cube), but must be at most 2"
        in dict(excesses("lift_ball", heavy)).values()
    )
