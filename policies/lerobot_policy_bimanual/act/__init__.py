"""Recipes for LeRobot's ACT, the baseline that predicts joint actions from RGB; the policy itself is LeRobot's.

Unless told otherwise, ACT reads all images of a dataset and fails if depth is among them: the recipes name its inputs.
"""
