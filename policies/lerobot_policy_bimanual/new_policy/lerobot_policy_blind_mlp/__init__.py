"""A policy in a distribution of its own, for the tasks of lerobot_bimanual and LeRobot's own commands.

It predicts the next keypose from where the hands are and how many keyposes have passed, without any image: what it
scores can be had by knowing the demonstrations' mean. A policy that sees should score more.

    pip install --no-build-isolation --no-deps -e .
    lerobot-bimanual policy benchmark --policy=blind_mlp --task=lift_ball

LeRobot finds the class and the processors by the names of the three files beside this one.
"""

from .configuration_blind_mlp import BlindMlpConfig

__all__ = ["BlindMlpConfig"]
