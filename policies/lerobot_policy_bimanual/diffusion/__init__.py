"""Recipes for LeRobot's Diffusion Policy, which predicts joint actions from RGB; the policy itself is LeRobot's."""
