"""The program `lerobot-bimanual-train`: it speaks before it imports LeRobot, which takes up to half a minute."""

import sys


def main() -> int:
    """Say that the program lives, then run it."""
    sys.stderr.write("lerobot-bimanual-train: importing LeRobot\n")
    from lerobot_policy_bimanual.training.train import main as train

    return train()
