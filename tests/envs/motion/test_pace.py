import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import CONTROL_HZ, by_arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.motion.pace import BESIDE_M, FREE, HEAVY_KG, is_beside_heavy
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene import Scene

JOINTS = PANDA_PAIR.joint_limits


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("name", list_tasks())
def test_no_experts_arm_is_sent_faster_than_the_pace_of_free_motions(name):
    env = BimanualEnv(name, split="val", obs="state")
    env.reset(seed=70000)
    sent = [env.scene.commanded] * 3
    env.tick_observers.append(lambda _, action: sent.append(action.copy()))
    run_episode(env, 70000, expert())
    env.close()
    joints = by_arm(np.array(sent, dtype=np.float64))[..., :-1]
    for order, most in (
        (1, FREE.velocity_share * JOINTS.velocity_rad_s),
        (2, FREE.acceleration_share * JOINTS.acceleration_rad_s2),
        (3, FREE.acceleration_share * JOINTS.jerk_rad_s3 * PHYSICS_STEP_S),
    ):
        rates = np.abs(np.diff(joints, n=order, axis=0)) * CONTROL_HZ ** min(order, 2)
        assert (rates <= 1.01 * most).all()


FINGERTIPS_M = 0.01
"""Beyond the tool centre point."""


@pytest.mark.parametrize(
    ("mass_kg", "gap_m", "is_beside"),
    [
        (HEAVY_KG, 0.5 * BESIDE_M, True),
        (HEAVY_KG, 1.5 * BESIDE_M, False),
        (0.9 * HEAVY_KG, 0.5 * BESIDE_M, False),
    ],
)
def test_a_hand_is_beside_a_heavy_thing_only_where_it_is_near(mass_kg, gap_m, is_beside):
    """With a box in the air, so far in front of the left hand's fingertips."""
    box = Box("box", mass_kg=mass_kg)
    scene = Scene((box,))
    scene.place("box", scene.tcp(Arm.LEFT) @ Pose.upright((0, 0, FINGERTIPS_M + gap_m + box.size_m[2] / 2)))
    assert is_beside_heavy(scene, Arm.LEFT) == is_beside
    assert not is_beside_heavy(scene, Arm.RIGHT)
