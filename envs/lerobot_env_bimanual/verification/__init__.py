"""Checks whether a dataset is what it claims to be: its tables, its images, and whether the simulation reproduces both."""
