import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.motion.carrying import props_in_hands
from lerobot_env_bimanual.motion.collision import CollisionChecker, CollisionRules
from lerobot_env_bimanual.motion.feasibility import goal_postures
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

HOME = PANDA_PAIR.home_joints


def _posture(arm: Arm, pose: Pose) -> np.ndarray:
    return goal_postures(PANDA_PAIR.kinematics[arm], HOME, pose.matrix)[0]


def free_motion(checker: CollisionChecker, *motion) -> CollisionRules:
    """Rules of a motion that begins now."""
    checker.look()
    return checker.free_motion_rules(*motion)


def _down(x: float, y: float, z: float) -> Pose:
    return Pose.looking((x, y, z), approach=(0, 0, -1), opening=(1, 0, 0))


def test_arms_at_home_are_free_and_overlapping_hands_are_not_unless_they_start_there(scene):
    checker = CollisionChecker(scene)
    rules = free_motion(checker, ARMS, [], HOME, HOME)
    kept = rules.least_distance_m.copy()
    assert checker.is_free(rules, HOME, HOME)
    left, right = (_posture(arm, _down(0.25, -0.1, 1.0)) for arm in ARMS)
    assert not checker.is_free(rules, left, right)
    obstacle = checker.obstacle(rules, left, right)
    assert obstacle is not None
    assert "left_" in obstacle
    assert "right_" in obstacle
    assert checker.is_free(free_motion(checker, ARMS, [], left, right), left, right)
    assert not checker.is_free(rules, left, right)  # rules are values
    assert np.array_equal(rules.least_distance_m, kept)


def test_free_motion_keeps_its_clearance_from_the_table_and_an_arm_that_is_not_checked_is_only_an_obstacle(
    scene,
):
    before, checker = scene.state_hash(), CollisionChecker(scene)
    rules = free_motion(checker, ARMS, [], HOME, HOME)
    for height_m, free in ((0.80, True), (0.77, False), (0.75, False)):
        assert checker.is_free(rules, _posture(Arm.LEFT, _down(0.25, 0.2, height_m)), HOME) is free
    through_table = _posture(Arm.RIGHT, _down(0.4, -0.3, 0.73))
    for checked, free in ((Arm.LEFT, True), (Arm.RIGHT, False)):
        rules = free_motion(checker, [checked], [], HOME, HOME)
        assert checker.is_free(rules, HOME, through_table) is free
    checker.is_free(checker.contact_rules, HOME + 0.3, HOME - 0.3)
    assert scene.state_hash() == before  # checking leaves the scene alone


def test_what_touches_at_the_start_may_go_on_touching(furnished_scene):
    scene = furnished_scene
    scene.place("wall", Pose.upright((0.5, 0.6, 0.2)))
    scene.place("block", Pose.upright((0.26, 0.2, 0.79)))
    at_block = _posture(Arm.LEFT, _down(0.25, 0.2, 0.83))
    checker = CollisionChecker(scene)
    rules = free_motion(checker, ARMS, [], HOME, HOME)
    assert checker.obstacle(rules, at_block, HOME) is not None
    rules = free_motion(checker, ARMS, [], at_block, HOME)
    assert checker.obstacle(rules, at_block, HOME) is None


def test_a_carried_prop_moves_with_the_hand(furnished_scene):
    scene = furnished_scene
    scene.place("block", Pose.upright((0.25, 0.2, 0.94)))
    scene.place("wall", Pose.upright((0.25, 0.40, 0.86)))
    holding = _posture(Arm.LEFT, _down(0.25, 0.2, 0.98))
    # The block hangs 8 cm below the hand and would end inside the wall; the hand stays above it.
    beyond = _posture(Arm.LEFT, _down(0.25, 0.40, 1.10))
    checker = CollisionChecker(scene)
    data_before = scene.data.qpos.copy()
    scene.data.qpos[:7] = holding
    rules = free_motion(checker, [Arm.LEFT], [(Arm.LEFT, "block")], holding, HOME)
    assert not checker.is_free(rules, beyond, HOME)
    rules = free_motion(checker, [Arm.LEFT], [], holding, HOME)
    assert checker.is_free(rules, beyond, HOME)
    scene.data.qpos[:] = data_before


def test_a_pinched_block_is_known_to_be_in_the_hand(furnished_scene):
    scene = furnished_scene
    scene.place("wall", Pose.upright((0.5, 0.6, 0.2)))
    tcp = scene.tcp(Arm.LEFT)
    scene.place("block", Pose(tcp.position, tcp.quat_wxyz))
    assert props_in_hands(scene) == []
    for finger in PANDA_PAIR.finger_names(Arm.LEFT):
        scene.set_joint(finger, 0.0199)
    assert props_in_hands(scene) == [(Arm.LEFT, "block")]
