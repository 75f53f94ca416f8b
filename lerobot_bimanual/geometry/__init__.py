"""Rotations, poses and boxes. NumPy here; `rotations_torch` holds the batched torch twins."""
