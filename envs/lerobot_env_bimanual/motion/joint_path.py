"""Smooth paths through joint space, and polylines with rounded corners to make them from."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

CUTS = (1.0, 0.5, 0.25, 0.125)
"""How much of the room for a rounding it takes, widest first. Two corners share the side between them."""
STEP_RAD = 0.035
"""Largest joint step between two knots of the result, and between two collision checks."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """One arm's joint path over the path parameter, 0 to 1, which both arms share.

    A natural cubic spline: velocity and acceleration are continuous at the knots. If its knots lie every 12 mm on a
    straight line of the hand, it deviates from the line by less than 0.1 mm. A path of only two knots is straight.

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


def rounded(polyline: Array, is_free: Callable[[Array], bool]) -> Array:
    """Knots (m, d) along a polyline (n, d) whose corners are replaced by parabolas, as wide as obstacles let them be.

    Args:
        polyline: rad; its first and last posture stay.
        is_free: whether a posture (d,) is free of collisions.

    Returns:
        Postures at equal steps along the way.
    """
    middles = 0.5 * (polyline[1:-2] + polyline[2:-1])
    starts, ends = np.concatenate([polyline[:1], middles]), np.concatenate([middles, polyline[-1:]])
    corners = zip(starts, polyline[1:-1], ends, strict=True) if len(polyline) > 2 else ()
    arcs = [_arc(*corner, is_free) for corner in corners]
    curve = np.concatenate([polyline[:1], *arcs, polyline[-1:]])
    length = np.append(0.0, np.abs(np.diff(curve, axis=0)).max(axis=1).cumsum())
    wanted = np.linspace(0.0, length[-1], int(np.ceil(length[-1] / STEP_RAD)) + 1)
    knots = np.stack([np.interp(wanted, length, joint) for joint in curve.T], axis=1)
    knots[0], knots[-1] = polyline[0], polyline[-1]
    return knots


def _arc(before: Array, corner: Array, after: Array, is_free: Callable[[Array], bool]) -> Array:
    """The widest free parabola (k, d) around a corner, at most between two postures; else the corner itself."""
    for cut in CUTS:
        start, end = corner + cut * (before - corner), corner + cut * (after - corner)
        count = 2 + int(
            np.ceil(np.abs(np.stack([start - corner, end - corner])).max(axis=1).sum() / STEP_RAD)
        )
        u = np.linspace(0.0, 1.0, count)[:, None]
        arc = (1 - u) ** 2 * start + 2 * u * (1 - u) * corner + u**2 * end
        if all(is_free(posture) for posture in arc[1:-1]):
            return arc
    return corner[None]
