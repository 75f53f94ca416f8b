"""Processors of RVT-LF, where LeRobot looks for them: its standard ones, as the policy normalises itself."""

from lerobot.processor import make_default_pre_post_processors as make_rvt_lf_pre_post_processors

__all__ = ["make_rvt_lf_pre_post_processors"]
