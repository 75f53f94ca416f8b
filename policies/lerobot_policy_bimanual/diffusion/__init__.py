"""Recipes for LeRobot's Diffusion Policy: of keyposes (`small`) and of joint actions (`paper`), both from RGB."""
