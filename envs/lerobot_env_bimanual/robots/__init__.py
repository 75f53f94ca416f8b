"""Robots: what a pair of arms is, and the pair we have."""
