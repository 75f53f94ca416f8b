"""Who can play an episode: the expert, and the controls that stand beside it."""

from typing import Literal, get_args

ControlName = Literal[
    "expert",
    "rereading",
    "blind",
    "random",
    "noop",
    "language_blind",
]
CONTROLS: tuple[ControlName, ...] = get_args(ControlName)
EXPERTS: tuple[ControlName, ...] = ("expert", "rereading")
"""Who must succeed, and leaves evidence of how; all others are measured beside them."""
