"""Sweeps: episodes of players on conditions and seeds, played on several cores and kept as soon as they are played."""
