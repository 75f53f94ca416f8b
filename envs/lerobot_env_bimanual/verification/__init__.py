"""Looks whether a dataset is what it claims to be: its tables, its images, and what the simulation says to both."""
