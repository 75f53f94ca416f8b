"""How far a servo may be sent at once."""

MAX_STEP_M, MAX_STEP_DEG = 0.05, 15.0
"""Largest movement and turn of a hand from one action to the next."""
