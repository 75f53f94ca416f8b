"""Keypose policies for two arms, as LeRobot policies.

Importing this package registers the configs, which is how LeRobot discovers policies; networks are imported
when a policy is made.
"""

from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config

__all__ = ["PerAct2Config"]
