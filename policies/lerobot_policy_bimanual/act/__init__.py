"""Recipes for LeRobot's ACT, the baseline that predicts joint actions from RGB; the policy itself is LeRobot's.

ACT takes every image of a dataset unless told, depth included, and fails at it: the recipes name its inputs.
"""
