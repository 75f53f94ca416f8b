import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import GRIPPER_FRAMES
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.motion import planner as planner_module
from lerobot_env_bimanual.motion.planner import REST_TICKS, KeyposeFailure, KeyposePlanner, Plan
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.scene import Scene

LEFT_DOWN = Pose.looking((0.15, 0.25, 1.0), approach=(0, 0, -1), opening=(1, 0, 0))
RIGHT_DOWN = Pose.looking((0.35, -0.25, 1.0), approach=(0, 0, -1), opening=(1, 0, 0))


def _keypose(left: Pose, right: Pose, straight=(False, False), opened=(True, True)) -> BimanualKeypose:
    arms = zip((left, right), opened, straight, strict=True)
    target = BimanualKeypose(*(Keypose(*arm) for arm in arms))
    return BimanualKeypose.from_vector(target.to_vector())  # as an action arrives


def _plan(scene: Scene, keypose: BimanualKeypose, seed: int = 0) -> Plan:
    """A plan, or its failure; planning changes nothing in the scene."""
    before = scene.state_hash()
    try:
        return KeyposePlanner(scene).plan(keypose, np.random.default_rng(seed))
    finally:
        assert scene.state_hash() == before


def _joints(plan: Plan) -> np.ndarray:
    """Of each tick and arm: (n, 2, 7)."""
    return plan.actions.reshape(-1, 2, 8)[..., :7]


def _execute(scene: Scene, plan: Plan) -> None:
    for action in plan.actions:
        scene.tick(action)


def _errors_m(scene: Scene, keypose: BimanualKeypose) -> list[float]:
    return [scene.tcp(arm).distance_to(keypose[arm].pose)[0] for arm in ARMS]


def test_an_executed_straight_motion_stays_on_its_line(scene):
    _execute(scene, _plan(scene, _keypose(LEFT_DOWN, RIGHT_DOWN)))
    keypose = _keypose(LEFT_DOWN.translated((0, 0, -0.2)), RIGHT_DOWN.translated((0, 0.1, -0.1)), [True] * 2)
    plan = _plan(scene, keypose)
    assert plan.line_fallbacks == 0
    for action in plan.actions:
        scene.tick(action)
        assert np.abs(scene.tcp(Arm.LEFT).position - LEFT_DOWN.position)[:2].max() < 5e-3
    assert max(_errors_m(scene, keypose)) < 3e-3


def test_actions_are_float32_far_from_the_joint_limits_and_both_arms_move_throughout_and_end_together(scene):
    far = _keypose(LEFT_DOWN, Pose.looking((0.3, -0.244, 1.4), (0, 0, -1), (1, 0, 0)))
    one_straight = _keypose(scene.tcp(Arm.LEFT).translated((0, 0, -0.1)), RIGHT_DOWN, (True, False))
    for plan in (_plan(scene, keypose) for keypose in (_keypose(LEFT_DOWN, RIGHT_DOWN), far, one_straight)):
        assert plan.line_fallbacks == 0
        assert plan.actions.dtype == np.float32
        assert (_joints(plan) > PANDA_PAIR.joint_lower).all()
        assert (_joints(plan) < PANDA_PAIR.joint_upper).all()
        assert np.diff(_joints(plan)[:-REST_TICKS], axis=0).any(axis=-1).all()
        assert (plan.actions[-REST_TICKS - 1 :] == plan.actions[-1]).all()
        ends = _joints(plan)[-1].astype(np.float64)
        assert min(PANDA_PAIR.kinematics[arm].margins(ends[arm.ordinal]).min() for arm in ARMS) > 0.04


def test_grippers_change_together_after_the_motion(scene):
    plan = _plan(scene, _keypose(LEFT_DOWN, RIGHT_DOWN, opened=(False, True)))
    moves = np.diff(_joints(plan), axis=0).any(axis=(1, 2))
    assert np.flatnonzero(moves)[-1] + 2 == len(plan.actions) - REST_TICKS - GRIPPER_FRAMES
    grippers = plan.actions.reshape(-1, 2, 8)[..., 7]
    assert (grippers[:-GRIPPER_FRAMES] == 1).all()
    assert (grippers[-GRIPPER_FRAMES:] == (0, 1)).all()


def test_an_arm_that_is_there_already_keeps_its_joints_exactly(scene):
    home = scene.commanded.reshape(2, 8)[:, :7]
    for straight in (False, True):
        keypose = _keypose(scene.tcp(Arm.LEFT), RIGHT_DOWN, (straight, straight))
        planned = _joints(_plan(scene, keypose))
        assert (planned[:, 0] == home[0]).all()
        assert not np.allclose(planned[-1, 1], home[1])


NEAR_WALL = Pose.looking((0.15, 0.08, 0.95), approach=(0, 0, -1), opening=(1, 0, 0))


@pytest.fixture
def walled_scene(furnished_scene) -> Scene:
    """The left hand in front of a wall."""
    furnished_scene.place("block", Pose.upright((0.6, 0.4, 0.79)))
    furnished_scene.place("wall", Pose.upright((0.15, 0.20, 0.95)))
    _execute(furnished_scene, _plan(furnished_scene, _keypose(NEAR_WALL, furnished_scene.tcp(Arm.RIGHT))))
    return furnished_scene


def test_a_way_around_a_wall_is_found_and_kept_clear_of(walled_scene):
    scene = walled_scene
    behind = _keypose(NEAR_WALL.translated((0, 0.24, 0)), scene.tcp(Arm.RIGHT))
    plan = _plan(scene, behind)
    for action in plan.actions:
        scene.tick(action)
        assert not scene.arm_touches(Arm.LEFT, "wall")
    assert max(_errors_m(scene, behind)) < 3e-3


def test_the_same_generator_gives_the_same_plan_whatever_was_planned_before(walled_scene):
    scene = walled_scene
    around = _keypose(NEAR_WALL.translated((0, 0.24, 0)), scene.tcp(Arm.RIGHT))
    used = KeyposePlanner(scene)
    for target, straight in ((NEAR_WALL, False), (NEAR_WALL.translated((0, 0, -0.05)), True)):
        used.plan(_keypose(target, RIGHT_DOWN, (straight, straight)), np.random.default_rng(9))
    plans = [_plan(scene, around, seed=3), used.plan(around, np.random.default_rng(3))]
    assert np.array_equal(plans[0].actions, plans[1].actions)
    assert not np.array_equal(plans[0].actions, _plan(scene, around, seed=4).actions)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize(
    ("arm", "position", "reason"),
    [
        (Arm.LEFT, (0.15, 0.25, 1.7), r"outside the workspace.*1\.700"),
        (Arm.RIGHT, (0.15, 0.25, 1.7), r"outside the workspace.*1\.700"),
        (Arm.RIGHT, (-0.29, -0.49, 0.61), "unreachable"),
    ],
)
def test_a_target_out_of_reach_is_refused_with_the_arms_name(scene, arm, position, reason, straight):
    target = Pose.looking(position, approach=(0, 0, -1), opening=(1, 0, 0))
    poses = [target if other is arm else scene.tcp(other) for other in ARMS]
    with pytest.raises(KeyposeFailure, match=f"{arm} arm: {reason}"):
        _plan(scene, _keypose(*poses, straight=(straight, straight)))


def test_a_goal_inside_an_obstacle_is_refused_with_its_name(furnished_scene):
    furnished_scene.place("block", Pose.upright((0.6, 0.4, 0.79)))
    furnished_scene.place("wall", Pose.upright((0.15, 0.25, 1.0)))
    keypose = _keypose(LEFT_DOWN, furnished_scene.tcp(Arm.RIGHT))
    with pytest.raises(KeyposeFailure, match=r"left arm: the goal is not free of collisions: .*wall"):
        _plan(furnished_scene, keypose)


def test_an_infeasible_line_falls_back_to_joint_space(scene, monkeypatch):
    monkeypatch.setattr(planner_module, "straight_lines", lambda requests: [None] * len(requests))
    keypose = _keypose(LEFT_DOWN, RIGHT_DOWN, straight=(True, True))
    plan = _plan(scene, keypose)
    assert plan.line_fallbacks == 2
    _execute(scene, plan)
    assert max(_errors_m(scene, keypose)) < 3e-3


def test_hands_that_change_sides_do_not_meet(scene):
    _execute(scene, _plan(scene, _keypose(LEFT_DOWN, RIGHT_DOWN)))
    swapped = _keypose(
        Pose.looking((0.20, -0.15, 1.0), (0, 0, -1), (1, 0, 0)),
        Pose.looking((0.30, 0.15, 1.0), (0, 0, -1), (1, 0, 0)),
    )
    plan = _plan(scene, swapped)
    for action in plan.actions:
        scene.tick(action)
        assert not scene.arm_touches(Arm.LEFT, "right_base")
    assert max(_errors_m(scene, swapped)) < 3e-3
