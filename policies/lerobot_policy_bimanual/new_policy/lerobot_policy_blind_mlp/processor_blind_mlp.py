"""Processors, where LeRobot looks for them: its standard ones."""

from lerobot.processor import make_default_pre_post_processors as make_blind_mlp_pre_post_processors

__all__ = ["make_blind_mlp_pre_post_processors"]
