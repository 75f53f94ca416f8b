"""Who can play an episode: the expert, and the controls that stand beside it."""

from typing import Literal, get_args

ControlName = Literal[
    "expert",
    "rereading",
    "planned_at_reset",
    "blind",
    "random",
    "noop",
    "solo_left",
    "solo_right",
    "language_blind",
]
CONTROLS: tuple[ControlName, ...] = get_args(ControlName)
EXPERTS: tuple[ControlName, ...] = ("expert", "rereading")
"""Who must succeed, and leaves evidence of how; all others are measured beside them."""
ROUNDABLE: tuple[ControlName, ...] = (*EXPERTS, "planned_at_reset")
"""Whose keyposes can be rounded: those of a script, exact to the last digit."""
