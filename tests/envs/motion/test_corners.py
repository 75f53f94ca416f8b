import numpy as np

from lerobot_env_bimanual.motion.corners import STEP_RAD, rounded

CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])


def _bends(knots: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(knots, n=2, axis=0), axis=1)


def test_a_corner_is_rounded_as_widely_as_its_sides_allow():
    knots = rounded(CORNER, lambda posture: True)
    assert np.array_equal(knots[[0, -1]], CORNER[[0, -1]])
    assert _bends(knots).max() < 0.2 * STEP_RAD
    assert np.linalg.norm(knots - CORNER[1], axis=1).min() > 0.3
    zigzag = rounded(np.concatenate([CORNER, [[2.0, 1.0]]]), lambda posture: True)
    assert _bends(zigzag).max() < 0.2 * STEP_RAD


def test_an_obstacle_inside_a_corner_makes_the_rounding_narrower():
    def is_free(posture: np.ndarray) -> bool:
        return bool(np.abs(posture - (0.8, 0.2)).max() > 0.1)

    knots = rounded(CORNER, is_free)
    assert all(is_free(knot) for knot in knots)
    assert _bends(knots).max() < STEP_RAD


def test_a_corner_without_any_room_stays():
    def is_free(posture: np.ndarray) -> bool:
        return bool(posture[1] < 1e-9 or posture[0] > 1 - 1e-9)

    assert np.linalg.norm(rounded(CORNER, is_free) - CORNER[1], axis=1).min() < STEP_RAD


def test_a_straight_way_stays_one_with_knots_at_equal_steps():
    knots = rounded(CORNER[:2], lambda posture: True)
    assert np.abs(_bends(knots)).max() < 1e-12
    assert np.abs(np.diff(knots, axis=0)).max() <= STEP_RAD
