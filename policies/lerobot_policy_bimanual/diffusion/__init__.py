"""Recipes for LeRobot's Diffusion Policy, which predicts keyposes (`small`) or joint actions (`paper`) from RGB; the policy itself is LeRobot's."""
