"""Verbs of `lerobot-bimanual` that need neither environment nor policies to be imported."""
