"""Perturbations of a world: axes with three levels each, as data and functions."""
