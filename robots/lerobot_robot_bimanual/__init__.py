"""Two simulated arms as a LeRobot robot, and a keyboard or a gamepad as their leader.

LeRobot's plugin discovery imports this package by its name's prefix; then the robot type `bimanual_sim` and the
teleoperator types `bimanual_keyboard` and `bimanual_gamepad` are registered. MuJoCo is loaded with the first robot.
"""

from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig
from lerobot_robot_bimanual.config_leaders import BimanualGamepadConfig, BimanualKeyboardConfig

__all__ = ["BimanualGamepadConfig", "BimanualKeyboardConfig", "BimanualSimConfig"]
