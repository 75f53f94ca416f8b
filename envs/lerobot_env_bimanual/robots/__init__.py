"""Robots: pairs of arms, and the pair that the tasks use."""
