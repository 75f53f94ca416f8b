"""Smooth ways through joint space."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class JointPath:
    """One arm's way over the path parameter, 0 to 1, that both arms have in common.

    A natural cubic spline: velocity and acceleration go through the knots without a jump. It leaves a straight line of
    the hand, of which it is given a knot every 12 mm, by less than 0.1 mm; between two knots it is straight.

    Attributes:
        knots: (n, 7) rad, at equal steps of the path parameter; at least two.
    """

    knots: Array

    @property
    def is_still(self) -> bool:
        """Whether the arm does not move at all."""
        return bool((self.knots == self.knots[0]).all())

    def at(self, fractions: Array) -> Array:
        """Joints (m, 7) in rad at path parameters (m,)."""
        spans = len(self.knots) - 1
        before = np.clip(np.ceil(fractions * spans).astype(int) - 1, 0, spans - 1)
        u = (fractions * spans - before)[:, None]
        v = 1.0 - u
        # Exact at both knots, so that a path ends where it was planned to end.
        straight = v * self.knots[before] + u * self.knots[before + 1]
        if spans == 1:
            return straight
        bent = (v**3 - v) * self._curvature[before] + (u**3 - u) * self._curvature[before + 1]
        return straight + bent / 6.0

    @functools.cached_property
    def _curvature(self) -> Array:
        """Second derivatives (n, 7) at the knots, per squared knot step; zero at both ends."""
        curvature = np.zeros_like(self.knots)
        inner = len(self.knots) - 2
        if inner > 0:
            bands = 4.0 * np.eye(inner) + np.eye(inner, k=1) + np.eye(inner, k=-1)
            curvature[1:-1] = np.linalg.solve(bands, 6.0 * np.diff(self.knots, n=2, axis=0))
        return curvature
