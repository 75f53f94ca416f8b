import numpy as np
import pytest

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import run_expert
from lerobot_env_bimanual.motion.pace import CONTACT, FREE
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S

JOINTS = PANDA_PAIR.joint_limits


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("name", list_tasks())
def test_no_experts_arm_is_sent_faster_than_the_pace_of_free_motions(name):
    env = BimanualEnv(name, split="val", obs="state")
    env.reset(seed=70000)
    sent = [env.scene.commanded] * 3
    env.tick_observers.append(lambda _, action: sent.append(action.copy()))
    run_expert(env, seed=70000)
    env.close()
    joints = by_arm(np.array(sent, dtype=np.float64))[..., :-1]
    for order, most in (
        (1, FREE.velocity_share * JOINTS.velocity_rad_s),
        (2, FREE.acceleration_share * JOINTS.acceleration_rad_s2),
        (3, FREE.acceleration_share * JOINTS.jerk_rad_s3 * PHYSICS_STEP_S),
    ):
        rates = np.abs(np.diff(joints, n=order, axis=0)) * CONTROL_HZ ** min(order, 2)
        assert (rates <= 1.01 * most).all()


def test_contact_is_gentler_than_free_motion_and_both_leave_the_arm_a_reserve():
    assert 1 > FREE.velocity_share > CONTACT.velocity_share
    assert 1 > FREE.acceleration_share > CONTACT.acceleration_share
    assert FREE.tip_m_s > CONTACT.tip_m_s
