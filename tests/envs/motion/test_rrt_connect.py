import itertools

import numpy as np

from lerobot_env_bimanual.motion.rrt_connect import edge_is_free, rrt_connect

START, GOAL = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
LOWER, UPPER = np.full(2, -2.0), np.full(2, 2.0)


def _around_the_wall(point: np.ndarray) -> bool:
    return not (abs(point[0]) < 0.1 and point[1] < 1.5)


def _find(is_free, seed: int = 0, max_iterations: int = 2000):
    return rrt_connect(START, GOAL, LOWER, UPPER, is_free, np.random.default_rng(seed), max_iterations)


def test_a_path_around_a_wall_is_found_short_and_free_and_the_generator_alone_decides_it():
    paths = [_find(_around_the_wall, seed) for seed in range(5)]
    for seed, path in enumerate(paths):
        assert path is not None
        assert np.array_equal(path[[0, -1]], [START, GOAL])
        assert all(edge_is_free(a, b, _around_the_wall) for a, b in itertools.pairwise(path))
        assert path[:, 1].max() > 1.5
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() < 1.3 * 2 * np.hypot(1.0, 1.5)
        assert np.array_equal(path, _find(_around_the_wall, seed))
    assert not np.array_equal(paths[3], paths[4])


def test_a_closed_wall_has_no_way_around():
    assert _find(lambda point: abs(point[0]) >= 0.1, max_iterations=300) is None
