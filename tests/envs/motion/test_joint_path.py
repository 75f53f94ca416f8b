import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.motion.joint_path import STEP_RAD, JointPath, rounded
from lerobot_env_bimanual.motion.lines import LineRequest, straight_lines
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

HOME = PANDA_PAIR.home_joints
WAVE = np.stack([HOME + 0.3 * np.sin(turn) for turn in np.linspace(0, 2, 8)])


def test_a_path_goes_exactly_through_its_knots_and_straight_between_two():
    assert np.array_equal(JointPath(WAVE).at(np.linspace(0, 1, 8))[[0, -1]], WAVE[[0, -1]])
    assert np.abs(JointPath(WAVE).at(np.linspace(0, 1, 8)) - WAVE).max() < 1e-12
    ends, share = WAVE[[0, 4]], np.linspace(0, 1, 11)[:, None]
    assert np.abs(JointPath(ends).at(share[:, 0]) - (ends[0] + share * (ends[1] - ends[0]))).max() < 1e-12


def test_neither_velocity_nor_acceleration_jumps_at_a_knot():
    step = 1e-3
    ways = JointPath(WAVE).at(np.arange(0, 1 + step / 2, step))
    curvature = np.diff(ways, n=2, axis=0) / step**2
    assert np.abs(np.diff(curvature, axis=0)).max() < 0.02 * np.abs(curvature).max()


def test_a_path_along_a_straight_line_keeps_the_hand_on_it():
    kinematics = PANDA_PAIR.kinematics[Arm.LEFT]
    start = kinematics.fk(HOME)
    target = start.copy()
    target[:3, 3] += (0.15, 0.2, -0.25)
    (knots,) = straight_lines([LineRequest(kinematics, HOME, target)])
    assert knots is not None
    way = (target - start)[:3, 3]
    shifts = np.array([kinematics.fk(q)[:3, 3] for q in JointPath(knots).at(np.linspace(0, 1, 200))])
    shifts -= start[:3, 3]
    aside = shifts - np.outer(shifts @ way, way) / (way @ way)
    assert np.linalg.norm(aside, axis=1).max() < 1e-4


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


def test_an_obstacle_inside_a_corner_makes_the_rounding_narrower_and_without_any_room_it_stays():
    def is_free(posture: np.ndarray) -> bool:
        return bool(np.abs(posture - (0.8, 0.2)).max() > 0.1)

    knots = rounded(CORNER, is_free)
    assert all(is_free(knot) for knot in knots)
    assert _bends(knots).max() < STEP_RAD
    stays = rounded(CORNER, lambda posture: bool(posture[1] < 1e-9 or posture[0] > 1 - 1e-9))
    assert np.linalg.norm(stays - CORNER[1], axis=1).min() < STEP_RAD
