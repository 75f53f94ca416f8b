"""Two simulated arms as a LeRobot robot, and a keyboard as their leader.

LeRobot's plugin discovery imports this package by its name's prefix; then the robot type `bimanual_sim` and the
teleoperator type `bimanual_keyboard` are registered. MuJoCo is loaded with the first robot.
"""

from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig
from lerobot_robot_bimanual.config_leaders import BimanualKeyboardConfig

__all__ = ["BimanualKeyboardConfig", "BimanualSimConfig"]
