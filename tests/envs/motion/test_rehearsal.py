"""Collisions of arms, and rehearsals of scripts."""

import re
from functools import partial

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.episode.rehearsal import Rehearsal, RehearsalView
from lerobot_env_bimanual.motion.carrying import props_in_hands
from lerobot_env_bimanual.motion.collision import CollisionChecker, CollisionRules
from lerobot_env_bimanual.motion.feasibility import goal_postures
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.world.scene import Scene

GRASP = Pose.looking((0.2, 0.2, 0.815), approach=(0, 0, -1), opening=(1, 0, 0))
CODECS = pytest.mark.parametrize("codec", [None, KeyposeCodec()], ids=["exact", "rounded"])


@pytest.fixture
def table_scene(furnished_scene) -> Scene:
    """A block in front of the left arm, and the wall out of the way."""
    furnished_scene.place("block", Pose.upright((0.2, 0.2, 0.79)))
    furnished_scene.place("wall", Pose.upright((0.25, 0.6, 0.2)))
    return furnished_scene


def _pick_up(view: Scene, above: Pose = GRASP):
    yield Stage("hover", left=above.translated((0, 0, 0.1)), planned=True)
    yield Stage("grasp", left=above, left_open=False, left_holds="block")
    yield Stage("lift", left=above.translated((0, 0.05, 0.2)))


@CODECS
def test_a_script_reads_where_rehearsed_arms_and_what_they_carry_are(table_scene, codec):
    before, heights_m, seen = table_scene.state_hash(), [], []

    def script(view):
        assert isinstance(view, RehearsalView)
        for stage in _pick_up(view):
            yield stage
            heights_m.append(view.pose("block").position[2])
            seen.append((view.tcp(Arm.LEFT).position, view.gripper_opening(Arm.LEFT)))
        yield Stage("release", left_open=True)
        yield Stage("away", left=GRASP.translated((0, 0, 0.3)))
        heights_m.append(view.pose("block").position[2])

    assert Rehearsal(table_scene, [codec]).infeasibility(script) is None
    assert heights_m == pytest.approx([0.79, 0.79, 0.99, 0.99], abs=0.006)
    offsets_m, openings = np.array([[0, 0, 0.1], [0, 0, 0], [0, 0.05, 0.2]]), [1, 0, 0]
    exact_m = 1e-6 if codec is None else 0.006
    assert np.allclose([tcp for tcp, _ in seen], GRASP.position + offsets_m, atol=exact_m)
    assert [opening for _, opening in seen] == openings
    assert table_scene.state_hash() == before


@CODECS
@pytest.mark.parametrize(
    ("offset", "reason"),
    [
        ((0.0, 0.0, 0.0), None),
        ((0.45, 0.28, 0.0), "hover: left arm out of reach|grasp: left arm|lift: left arm"),
        ((0.6, 0.0, 0.0), "hover: target outside the workspace"),
    ],
)
def test_placements_out_of_reach_are_rejected_with_a_reason(table_scene, offset, reason, codec):
    result = Rehearsal(table_scene, [codec]).infeasibility(lambda v: _pick_up(v, GRASP.translated(offset)))
    assert result is None if reason is None else re.match(reason, result or "")


def test_collisions_of_a_hand_a_goal_and_a_stationary_arm_are_rejected(table_scene):
    def into_the_table(view):
        yield Stage("hover", left=GRASP.translated((0, 0, 0.1)), planned=True)
        yield Stage("down", left=GRASP.translated((0.1, 0, -0.07)))

    assert "collision" in (Rehearsal(table_scene).infeasibility(into_the_table) or "")
    table_scene.place("wall", Pose.upright((0.2, 0.2, 0.915)))
    assert Rehearsal(table_scene).infeasibility(_pick_up) == "hover: no collision-free posture"
    link = table_scene.data.body("left_link5").xpos
    for outward_m, expected in ((0.0, "too close"), (0.6, "None")):
        table_scene.place("wall", Pose.upright(np.add(link, (0, outward_m, 0))))
        reason = Rehearsal(table_scene).infeasibility(lambda view: iter(()))
        assert str(reason).startswith(expected)


def test_one_infeasible_codec_among_several_is_enough(table_scene):
    used = Rehearsal(table_scene, [None, KeyposeCodec()])
    for shift_m in ((0, 0, 0), (0.25, 0.05, 0), (0.4, 0.2, 0), (0, 0, 0)):
        table_scene.place("block", Pose.upright(np.add((0.2, 0.2, 0.79), shift_m)))
        script = partial(_pick_up, above=GRASP.translated(shift_m))
        alone = [Rehearsal(table_scene, [codec]).infeasibility(script) for codec in (None, KeyposeCodec())]
        together = used.infeasibility(script)  # whatever was rehearsed before
        assert (together is None) == (alone == [None, None])
        assert together in alone


HOME = PANDA_PAIR.home_joints


def _posture(arm: Arm, pose: Pose) -> np.ndarray:
    return goal_postures(PANDA_PAIR.kinematics[arm], HOME, pose.matrix)[0]


def free_motion(checker: CollisionChecker, *motion) -> CollisionRules:
    """Rules of a motion that begins now."""
    checker.update_from_scene()
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


def test_free_motion_keeps_clear_of_the_table_and_an_arm_that_is_not_checked_is_an_obstacle(scene):
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
    scene.data.qpos[:7] = holding
    rules = free_motion(checker, [Arm.LEFT], [(Arm.LEFT, "block")], holding, HOME)
    assert not checker.is_free(rules, beyond, HOME)
    rules = free_motion(checker, [Arm.LEFT], [], holding, HOME)
    assert checker.is_free(rules, beyond, HOME)


def test_a_pinched_block_is_known_to_be_in_the_hand(furnished_scene):
    scene = furnished_scene
    scene.place("wall", Pose.upright((0.5, 0.6, 0.2)))
    tcp = scene.tcp(Arm.LEFT)
    scene.place("block", Pose(tcp.position, tcp.quat_wxyz))
    assert props_in_hands(scene) == []
    for finger in PANDA_PAIR.finger_names(Arm.LEFT):
        scene.set_joint(finger, 0.0199)
    assert props_in_hands(scene) == [(Arm.LEFT, "block")]
