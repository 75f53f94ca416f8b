"""Polylines with their corners rounded, so that they can be travelled without stopping."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

CUTS = (1.0, 0.5, 0.25, 0.125)
"""How much of the room for a rounding it takes, widest first. Two corners share the side between them."""
STEP_RAD = 0.035
"""Largest joint step between two knots of the result, and between two collision checks."""


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
