import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_env_bimanual.motion.joint_path import JointPath
from lerobot_env_bimanual.motion.pace import CONTACT, FREE, PUSHING, Pace
from lerobot_env_bimanual.motion.time_law import SMOOTHING_S, tick_fractions
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

HOME = PANDA_PAIR.home_joints
JOINTS = PANDA_PAIR.joint_limits
BOTH = [PANDA_PAIR.kinematics[arm] for arm in ARMS]
STILL = JointPath(np.stack([HOME, HOME]))


def swing(*angles: float) -> JointPath:
    """A path that only turns the first joint."""
    return JointPath(np.array([[angle, *HOME[1:]] for angle in angles]))


def law(left: JointPath, right: JointPath = STILL, pace: Pace = FREE) -> np.ndarray:
    return tick_fractions([left, right], BOTH, [pace.limits(JOINTS)] * 2)


def rates(joints: np.ndarray) -> list[np.ndarray]:
    """Velocity, acceleration, and its step from tick to tick, of a motion from rest to rest."""
    at_rest = np.concatenate([np.repeat(joints[:1], 2, axis=0), joints, np.repeat(joints[-1:], 2, axis=0)])
    return [
        np.abs(np.diff(at_rest, n=order, axis=0)).max(axis=0) * CONTROL_HZ ** min(order, 2)
        for order in (1, 2, 3)
    ]


def random_path(rng: np.random.Generator) -> JointPath:
    """A winding path with up to seven knots."""
    steps = rng.uniform(-0.4, 0.4, size=(rng.integers(1, 7), 7))
    return JointPath(np.cumsum(np.concatenate([HOME[None], steps]), axis=0))


@pytest.mark.parametrize("pace", [FREE, CONTACT, PUSHING])
@pytest.mark.parametrize("seed", range(10))
def test_no_motion_breaks_a_limit_of_velocity_acceleration_or_jerk(pace, seed):
    rng = np.random.default_rng(seed)
    paths = [random_path(rng), random_path(rng)]
    fractions = law(*paths, pace)
    assert (np.diff(fractions) >= 0).all()
    assert fractions[-1] == 1.0
    for path in paths:
        velocity, acceleration, step = rates(path.at(np.append(0.0, fractions)))
        assert (velocity <= 1.001 * pace.velocity_share * JOINTS.velocity_rad_s).all()
        assert (acceleration <= 1.001 * pace.acceleration_share * JOINTS.acceleration_rad_s2).all()
        assert (step <= 1.001 * pace.acceleration_share * JOINTS.jerk_rad_s3 * 0.002).all()


def test_a_long_swing_uses_the_speed_it_may_and_takes_hardly_longer_than_it_must():
    path, pace = swing(0, 2.0), Pace(velocity_share=0.5, acceleration_share=0.2, tip_m_s=9.0)
    speed, push = 0.5 * JOINTS.velocity_rad_s[0], 0.2 * JOINTS.acceleration_rad_s2[0]
    fastest_s = 2.0 / speed + speed / push
    ticks = len(law(path, pace=pace))
    assert fastest_s * CONTROL_HZ < ticks <= (fastest_s + SMOOTHING_S) * CONTROL_HZ + 2
    velocity = rates(path.at(np.append(0.0, law(path, pace=pace))))[0][0]
    assert velocity > 0.97 * speed


@pytest.mark.parametrize("pace", [FREE, CONTACT, PUSHING])
@pytest.mark.parametrize("path", [swing(0, 1.5), swing(0, 0.1, 1.2, 1.3), swing(0, -0.4), swing(0, 1)])
def test_the_tip_keeps_its_greatest_speed_and_gains_it_slowly_where_it_pushes(path, pace):
    joints = path.at(np.append(0.0, law(path, pace=pace)))
    tips_m = np.array([BOTH[0].fk(posture)[:3, 3] for posture in joints])
    speed_m_s = np.linalg.norm(np.diff(tips_m, axis=0), axis=1) * CONTROL_HZ
    gains_m_s2 = np.diff(speed_m_s) * CONTROL_HZ
    assert speed_m_s.max() < 1.02 * pace.tip_m_s
    if len(path.knots) == 2:
        assert (gains_m_s2.max() <= 1.1 * PUSHING.tip_m_s2) == (pace is PUSHING)
        assert gains_m_s2.min() < -2 * PUSHING.tip_m_s2  # it brakes as fast as others


def test_the_slower_arm_decides_the_duration_and_arms_that_stand_still_take_no_time():
    short, long, small = swing(0, 0.2), swing(0, 1.0), swing(0, 1e-3)
    assert len(law(long, short)) == len(law(short, long)) == len(law(long))
    assert len(law(STILL)) == 0
    assert 1 <= len(law(small)) <= 5
    assert np.array_equal(small.at(law(small))[-1], small.knots[-1])
