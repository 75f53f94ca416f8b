"""Vector environments for evaluation, and what they record of their episodes."""
