"""Use the environment as any Gymnasium environment, with both kinds of action.

python examples/00_step_the_environment.py
"""

import gymnasium as gym

import lerobot_env_bimanual  # noqa: F401  registers the bimanual/... ids
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.pinhole import unproject
from lerobot_bimanual.keypose import BimanualKeypose, Keypose

env = gym.make("bimanual/PushBox-v0", image_size=128)
observation, info = env.reset(seed=0)
print(env.unwrapped.task_description, info["conditions"])

# A joint action is one control tick of 50 ms: per arm, left first, seven joints and the gripper (1 is open).
observation, reward, terminated, truncated, info = env.step(observation["agent_pos"])

# A keypose is a whole motion of both arms: here straight down by 10 cm, grippers open.
scene = env.unwrapped.scene
lowered = [Keypose(scene.tcp(arm).translated([0, 0, -0.1]), True, True) for arm in ARMS]
observation, reward, terminated, truncated, info = env.step(BimanualKeypose(*lowered).to_vector())
print(f"{info['ticks']} ticks of 50 ms, hands now at", observation["ee_pose"].round(3))

# Depth is in millimetres, and every camera is calibrated in each observation.
depth_m = observation["images.front_depth"][0] / 1000
world_T_camera = observation["camera_extrinsics"][:16].reshape(4, 4)  # noqa: N816
intrinsics = observation["camera_intrinsics"][:9].reshape(3, 3)
points = unproject(depth_m, intrinsics, world_T_camera)
print("world point in the middle of the front image:", points[64, 64].round(3))
env.close()
