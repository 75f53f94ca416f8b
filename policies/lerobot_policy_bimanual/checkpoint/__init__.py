"""Checkpoints, read as data before a loader touches them."""
