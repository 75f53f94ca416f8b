"""A policy in a distribution of its own, for the tasks of lerobot_bimanual and LeRobot's own commands.

It predicts the next keypose from where the hands are and how many keyposes have passed, without any image: what it
scores can be had by knowing the demonstrations' mean. A policy that sees should score more.

    pip install -e examples/08_own_policy
    lerobot-train --policy.type=blind_mlp --dataset.repo_id=local/lift_ball --dataset.root=data/lift_ball ...
    lerobot-eval --policy.path=... --env.type=bimanual --env.task=lift_ball --env.obs=state

LeRobot finds the class and the processors by the names of the three files beside this one.
"""

from lerobot_policy_blind_mlp.configuration_blind_mlp import BlindMlpConfig

__all__ = ["BlindMlpConfig"]
