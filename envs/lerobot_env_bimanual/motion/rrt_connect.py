"""RRT-Connect: two random trees in joint space that grow towards each other.

Kuffner and LaValle, "RRT-Connect: An Efficient Approach to Single-Query Path Planning", ICRA 2000, with
shortening of the path by random cuts. Limits count iterations, never time, so that the same generator
gives the same path on any machine.
"""

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
IsFree = Callable[[Array], bool]

EXTENSION_RAD = 0.5
EDGE_STEP_RAD = 0.035
"""Largest joint step between two collision checks along an edge."""
GOAL_BIAS = 4
"""Every fourth sample is the root of the other tree."""
SHORTCUTS = 40


class _Tree:
    """Postures, each with the index of its parent; the first one is the root."""

    def __init__(self, root: Array, capacity: int):
        self._postures = np.empty((capacity, len(root)))
        self._parents = [-1]
        self._postures[0] = root

    @property
    def postures(self) -> Array:
        return self._postures[: len(self._parents)]

    def add(self, posture: Array, parent: int) -> int:
        index = len(self._parents)
        if index == len(self._postures):
            self._postures = np.concatenate([self._postures, np.empty_like(self._postures)])
        self._postures[index] = posture
        self._parents.append(parent)
        return index

    def nearest(self, posture: Array) -> int:
        return int(((self.postures - posture) ** 2).sum(axis=1).argmin())

    def to_root(self, index: int) -> list[Array]:
        path = []
        while index >= 0:
            path.append(self._postures[index].copy())
            index = self._parents[index]
        return path


def rrt_connect(
    start: Array,
    goal: Array,
    lower: Array,
    upper: Array,
    is_free: IsFree,
    rng: np.random.Generator,
    max_iterations: int,
) -> Array | None:
    """Collision-free polyline between two postures.

    Args:
        start: (d,) rad, taken to be free.
        goal: (d,) rad, free.
        lower: (d,) rad, smallest sampled joints.
        upper: (d,) rad, largest sampled joints.
        is_free: whether a posture (d,) is free of collisions.
        rng: source of all randomness.
        max_iterations: samples before giving up.

    Returns:
        Postures (n, d) from start to goal, or None.
    """
    trees = [_Tree(start, max_iterations), _Tree(goal, max_iterations)]
    for iteration in range(max_iterations):
        grown, other = trees if iteration % 2 == 0 else trees[::-1]
        sample = rng.uniform(lower, upper) if iteration % GOAL_BIAS else other.postures[0]
        index = _extend(grown, grown.nearest(sample), sample, is_free)
        if index is None:
            continue
        meeting = _connect(other, grown.postures[index], is_free)
        if meeting is None:
            continue
        path = np.array(grown.to_root(index)[::-1] + other.to_root(meeting)[1:])
        return _shortened(path if grown is trees[0] else path[::-1], is_free, rng)
    return None


def is_edge_free(a: Array, b: Array, is_free: IsFree) -> bool:
    """Whether the straight way from `a` (not checked) to `b` is free, looked at in small steps."""
    steps = max(1, int(np.ceil(np.abs(b - a).max() / EDGE_STEP_RAD)))
    return all(is_free(a + (b - a) * (k / steps)) for k in _coarse_to_fine(steps))


@functools.cache
def _coarse_to_fine(count: int) -> list[int]:
    """1 to `count`, multiples of large powers of two first: a blocked edge is found out after a few checks."""
    return sorted(range(1, count + 1), key=lambda k: -(k & -k))


def _extend(tree: _Tree, nearest: int, target: Array, is_free: IsFree) -> int | None:
    """Grow one branch towards `target`; index of its end, or None if it is blocked."""
    start = tree.postures[nearest]
    way = target - start
    distance = np.linalg.norm(way)
    if distance < 1e-9:
        return None
    end = target if distance <= EXTENSION_RAD else start + way * (EXTENSION_RAD / distance)
    return tree.add(end, nearest) if is_edge_free(start, end, is_free) else None


def _connect(tree: _Tree, target: Array, is_free: IsFree) -> int | None:
    """Grow the tree to `target` itself; index of that posture, or None if it is blocked on the way."""
    target = target.copy()
    index = tree.nearest(target)
    while not np.array_equal(tree.postures[index], target):
        end = _extend(tree, index, target, is_free)
        if end is None:
            return None
        index = end
    return index


def _shortened(path: Array, is_free: IsFree, rng: np.random.Generator) -> Array:
    """Replace random stretches of a polyline (n, d) by the straight way, where that is free."""
    for _ in range(SHORTCUTS):
        if len(path) < 3:
            break
        length = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
        cuts = np.sort(rng.uniform(0.0, length[-1], 2))
        first, last = np.searchsorted(length, cuts, side="right") - 1
        if first == last:
            continue
        before, after = length[[first, last]], length[[first + 1, last + 1]]
        share = ((cuts - before) / (after - before))[:, None]
        ends = (1.0 - share) * path[[first, last]] + share * path[[first + 1, last + 1]]
        if is_edge_free(ends[0], ends[1], is_free):
            path = np.concatenate([path[: first + 1], ends, path[last + 1 :]])
    return path
