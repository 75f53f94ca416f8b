"""Two simulated arms as a LeRobot robot.

LeRobot's plugin discovery imports this package by its name's prefix; then the robot type `bimanual_sim` is registered.
MuJoCo is loaded with the first robot.
"""

from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig

__all__ = ["BimanualSimConfig"]
