from dataclasses import replace

import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.motion.pushing import BESIDE_M, HEAVY_KG, is_beside_heavy
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.world.scene import Scene

BOX = Box("box", mass_kg=HEAVY_KG)
FINGERTIPS_M = 0.01
"""Beyond the tool centre point."""


def scene_with_box(box: Box, gap_m: float) -> Scene:
    """A box in the air, so far in front of the left hand's fingertips."""
    scene = Scene((box,))
    ahead_m = FINGERTIPS_M + gap_m + box.size_m[2] / 2
    scene.place("box", scene.tcp(Arm.LEFT) @ Pose.upright((0, 0, ahead_m)))
    return scene


@pytest.mark.parametrize(("gap_m", "is_beside"), [(0.5 * BESIDE_M, True), (1.5 * BESIDE_M, False)])
def test_a_hand_is_beside_a_heavy_thing_only_where_it_is_near(gap_m, is_beside):
    scene = scene_with_box(BOX, gap_m)
    assert is_beside_heavy(scene, Arm.LEFT) == is_beside
    assert not is_beside_heavy(scene, Arm.RIGHT)


def test_no_light_thing_counts():
    assert not is_beside_heavy(scene_with_box(replace(BOX, mass_kg=0.9 * HEAVY_KG), 0.01), Arm.LEFT)


@pytest.mark.parametrize("name", list_tasks())
def test_no_episode_starts_beside_a_heavy_thing(name):
    env = BimanualEnv(name, obs="state")
    env.reset(seed=0)
    assert not any(is_beside_heavy(env.scene, arm) for arm in ARMS)
    env.close()
