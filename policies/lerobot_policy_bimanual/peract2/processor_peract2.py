"""Processors of PerAct2, where LeRobot looks for them: its standard ones, as the policy normalises itself."""

from lerobot.processor import make_default_pre_post_processors as make_peract2_pre_post_processors

__all__ = ["make_peract2_pre_post_processors"]
