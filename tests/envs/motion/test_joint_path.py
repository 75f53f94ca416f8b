"""Paths through joint space, and how fast they are followed."""

import itertools

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_env_bimanual.motion import time_law
from lerobot_env_bimanual.motion.joint_path import STEP_RAD, JointPath, rounded
from lerobot_env_bimanual.motion.rrt_connect import is_edge_free, rrt_connect
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.scene import Scene

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


def test_an_obstacle_inside_a_corner_narrows_the_rounding_and_without_room_the_corner_stays():
    def is_free(posture: np.ndarray) -> bool:
        return bool(np.abs(posture - (0.8, 0.2)).max() > 0.1)

    knots = rounded(CORNER, is_free)
    assert all(is_free(knot) for knot in knots)
    assert _bends(knots).max() < STEP_RAD
    stays = rounded(CORNER, lambda posture: bool(posture[1] < 1e-9 or posture[0] > 1 - 1e-9))
    assert np.linalg.norm(stays - CORNER[1], axis=1).min() < STEP_RAD


START, GOAL = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
LOWER, UPPER = np.full(2, -2.0), np.full(2, 2.0)


def _around_the_wall(point: np.ndarray) -> bool:
    return not (abs(point[0]) < 0.1 and point[1] < 1.5)


def _find(is_free, seed: int = 0, max_iterations: int = 2000):
    return rrt_connect(START, GOAL, LOWER, UPPER, is_free, np.random.default_rng(seed), max_iterations)


def test_a_path_around_a_wall_is_short_and_free_and_depends_only_on_the_generator():
    paths = [_find(_around_the_wall, seed) for seed in range(5)]
    for seed, path in enumerate(paths):
        assert path is not None
        assert np.array_equal(path[[0, -1]], [START, GOAL])
        assert all(is_edge_free(a, b, _around_the_wall) for a, b in itertools.pairwise(path))
        assert path[:, 1].max() > 1.5
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() < 1.3 * 2 * np.hypot(1.0, 1.5)
        assert np.array_equal(path, _find(_around_the_wall, seed))
    assert not np.array_equal(paths[3], paths[4])


def test_a_closed_wall_has_no_way_around():
    assert _find(lambda point: abs(point[0]) >= 0.1, max_iterations=300) is None


STILL = JointPath(np.stack([HOME, HOME]))


def swing(*angles: float) -> JointPath:
    """A path that only turns the first joint."""
    return JointPath(np.array([[angle, *HOME[1:]] for angle in angles]))


def law(left: JointPath, right: JointPath = STILL, pace: time_law.Pace = time_law.FREE) -> np.ndarray:
    return time_law.tick_fractions([left, right], [pace] * 2)


def rates(joints: np.ndarray) -> list[np.ndarray]:
    """Velocity, acceleration, and its step from tick to tick, of a motion from rest to rest."""
    at_rest = np.concatenate([np.repeat(joints[:1], 2, axis=0), joints, np.repeat(joints[-1:], 2, axis=0)])
    return [np.abs(np.diff(at_rest, n=n, axis=0)).max(axis=0) * CONTROL_HZ ** min(n, 2) for n in (1, 2, 3)]


def random_path(rng: np.random.Generator) -> JointPath:
    """A winding path with up to seven knots."""
    steps = rng.uniform(-0.4, 0.4, size=(rng.integers(1, 7), 7))
    return JointPath(np.cumsum(np.concatenate([HOME[None], steps]), axis=0))


@pytest.mark.parametrize("pace", [time_law.FREE, time_law.CONTACT, time_law.PUSHING])
@pytest.mark.parametrize("seed", range(10))
def test_no_motion_breaks_a_limit_of_velocity_acceleration_or_jerk(pace, seed):
    rng = np.random.default_rng(seed)
    paths = [random_path(rng), random_path(rng)]
    fractions = law(*paths, pace)
    assert (np.diff(fractions) >= 0).all()
    assert fractions[-1] == 1.0
    for path in paths:
        velocity, acceleration, step = rates(path.at(np.append(0.0, fractions)))
        assert (velocity <= 1.001 * pace.velocity_share * PANDA_PAIR.velocity_limit_rad_s).all()
        assert (acceleration <= 1.001 * pace.acceleration_share * PANDA_PAIR.acceleration_limit_rad_s2).all()
        assert (step <= 1.001 * pace.acceleration_share * PANDA_PAIR.jerk_limit_rad_s3 * 0.002).all()


def test_a_long_swing_reaches_the_allowed_speed_and_takes_little_more_than_the_minimum_time():
    path, pace = swing(0, 2.0), time_law.Pace(velocity_share=0.5, acceleration_share=0.2, tip_m_s=9.0)
    speed, push = 0.5 * PANDA_PAIR.velocity_limit_rad_s[0], 0.2 * PANDA_PAIR.acceleration_limit_rad_s2[0]
    fastest_s = 2.0 / speed + speed / push
    ticks = len(law(path, pace=pace))
    assert fastest_s * CONTROL_HZ < ticks <= (fastest_s + time_law.SMOOTHING_S) * CONTROL_HZ + 2
    velocity = rates(path.at(np.append(0.0, law(path, pace=pace))))[0][0]
    assert velocity > 0.97 * speed


@pytest.mark.parametrize("pace", [time_law.FREE, time_law.CONTACT, time_law.PUSHING])
@pytest.mark.parametrize("path", [swing(0, 1.5), swing(0, 0.1, 1.2, 1.3), swing(0, -0.4), swing(0, 1)])
def test_the_tip_keeps_its_greatest_speed_and_gains_it_slowly_where_it_pushes(path, pace):
    joints = path.at(np.append(0.0, law(path, pace=pace)))
    tips_m = np.array([PANDA_PAIR.kinematics[Arm.LEFT].fk(posture)[:3, 3] for posture in joints])
    speed_m_s = np.linalg.norm(np.diff(tips_m, axis=0), axis=1) * CONTROL_HZ
    gains_m_s2 = np.diff(speed_m_s) * CONTROL_HZ
    assert speed_m_s.max() < 1.02 * pace.tip_m_s
    if len(path.knots) == 2:
        assert (gains_m_s2.max() <= 1.1 * time_law.PUSHING.tip_m_s2) == (pace is time_law.PUSHING)
        assert gains_m_s2.min() < -2 * time_law.PUSHING.tip_m_s2  # it brakes as fast as others


def test_the_slower_arm_decides_the_duration_and_arms_that_stand_still_take_no_time():
    short, long, small = swing(0, 0.2), swing(0, 1.0), swing(0, 1e-3)
    assert len(law(long, short)) == len(law(short, long)) == len(law(long))
    assert len(law(STILL)) == 0
    assert 1 <= len(law(small)) <= 5
    assert np.array_equal(small.at(law(small))[-1], small.knots[-1])


@pytest.mark.parametrize(
    ("mass_kg", "gap_m", "is_beside"),
    [
        (time_law.HEAVY_KG, 0.5 * time_law.BESIDE_M, True),
        (time_law.HEAVY_KG, 1.5 * time_law.BESIDE_M, False),
        (0.9 * time_law.HEAVY_KG, 0.5 * time_law.BESIDE_M, False),
    ],
)
def test_a_hand_is_beside_a_heavy_thing_only_where_it_is_near(mass_kg, gap_m, is_beside):
    """With a box in the air, so far in front of the left hand's fingertips, 1 cm beyond the tool centre point."""
    box = Box("box", mass_kg=mass_kg)
    scene = Scene((box,))
    scene.place("box", scene.tcp(Arm.LEFT) @ Pose.upright((0, 0, 0.01 + gap_m + box.size_m[2] / 2)))
    assert time_law.is_beside_heavy(scene, Arm.LEFT) == is_beside
    assert not time_law.is_beside_heavy(scene, Arm.RIGHT)
