import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_env_bimanual.motion.time_law import (
    CONTACT_SPEED,
    FREE_SPEED,
    MIN_DURATION_S,
    JointPath,
    minimum_jerk,
    tick_fractions,
)
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

HOME = PANDA_PAIR.home_joints
BOTH = [PANDA_PAIR.kinematics[arm] for arm in ARMS]
STILL = JointPath.even(np.stack([HOME, HOME]))


def _swing(*angles: float) -> JointPath:
    """A path that only turns the first joint."""
    return JointPath.even(np.array([[angle, *HOME[1:]] for angle in angles]))


def test_the_law_rests_at_both_ends_and_never_goes_back():
    shares = minimum_jerk(np.linspace(0, 1, 101))
    assert (shares[0], shares[-1]) == (0, 1)
    assert (np.diff(shares) > 0).all()
    assert shares[1] < 1e-4
    assert shares[-2] > 1 - 1e-4


@pytest.mark.parametrize("limits", [FREE_SPEED, CONTACT_SPEED])
@pytest.mark.parametrize("path", [_swing(0, 1.5), _swing(0, 0.1, 1.2, 1.3), _swing(0, -0.4)])
def test_neither_joints_nor_tip_exceed_their_peak_speed(path, limits):
    fractions = tick_fractions([path, STILL], BOTH, [limits, limits])
    joints = np.concatenate([path.knots[:1], path.at(fractions)])
    tips = np.array([BOTH[0].fk(posture)[:3, 3] for posture in joints])
    assert (np.diff(fractions) > 0).all()
    assert np.abs(np.diff(joints, axis=0)).max() * CONTROL_HZ < 1.01 * limits.joint_rad_s
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() * CONTROL_HZ < 1.01 * limits.tip_m_s


def test_a_hasty_stretch_does_not_slow_down_the_whole_motion():
    slow = tick_fractions([_swing(0, 0.5, 1.0), STILL], BOTH, [FREE_SPEED] * 2)
    uneven = JointPath(np.array([0.0, 0.1, 1.0]), _swing(0, 0.5, 1.0).knots)
    assert len(tick_fractions([uneven, STILL], BOTH, [FREE_SPEED] * 2)) <= len(slow) + 1


def test_the_slower_arm_decides_the_duration():
    short, long = _swing(0, 0.2), _swing(0, 1.0)
    alone = tick_fractions([long, STILL], BOTH, [FREE_SPEED] * 2)
    assert len(tick_fractions([long, short], BOTH, [FREE_SPEED] * 2)) == len(alone)
    assert len(tick_fractions([short, long], BOTH, [FREE_SPEED] * 2)) == len(alone)


def test_the_shortest_motion_takes_its_least_duration_and_ends_exactly():
    for path in (STILL, _swing(0, 1e-3)):
        fractions = tick_fractions([path, STILL], BOTH, [FREE_SPEED] * 2)
        assert len(fractions) == round(MIN_DURATION_S * CONTROL_HZ)
        assert np.array_equal(path.at(fractions)[-1], path.knots[-1])
