"""Checkpoints from anyone: they are data, and are read as data before a loader touches them."""
