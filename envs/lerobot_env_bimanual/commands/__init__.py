"""Verbs of `lerobot-bimanual` that need the environment."""
