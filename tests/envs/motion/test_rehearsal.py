import re
from functools import partial

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.episode.rehearsal import Rehearsal, RehearsalView
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
def test_a_feasible_script_passes_and_leaves_the_scene_alone(table_scene, codec):
    before = table_scene.state_hash()
    assert Rehearsal(table_scene, [codec]).infeasibility(_pick_up) is None
    assert table_scene.state_hash() == before


@CODECS
def test_a_grasped_prop_moves_with_the_hand_until_it_is_released(table_scene, codec):
    heights = []

    def script(view):
        for stage in _pick_up(view):
            yield stage
            heights.append(view.pose("block").position[2])
        yield Stage("release", left_open=True)
        yield Stage("away", left=GRASP.translated((0, 0, 0.3)))
        heights.append(view.pose("block").position[2])

    assert Rehearsal(table_scene, [codec]).infeasibility(script) is None
    assert heights == pytest.approx([0.79, 0.79, 0.99, 0.99], abs=0.006)


def test_a_script_reads_where_the_rehearsed_arms_are(table_scene):
    seen = []

    def script(view):
        assert isinstance(view, RehearsalView)
        yield Stage("hover", left=GRASP.translated((0, 0, 0.1)), planned=True)
        seen.append((view.tcp(Arm.LEFT), view.gripper_opening(Arm.LEFT)))
        yield Stage("close", left_open=False)
        seen.append((view.tcp(Arm.LEFT), view.gripper_opening(Arm.LEFT)))

    assert Rehearsal(table_scene).infeasibility(script) is None
    for (tcp, opening), expected in zip(seen, (1, 0), strict=True):
        assert np.allclose(tcp.position, GRASP.translated((0, 0, 0.1)).position, atol=1e-6)
        assert opening == expected


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
    result = Rehearsal(table_scene, [codec]).infeasibility(
        lambda view: _pick_up(view, GRASP.translated(offset))
    )
    assert result is None if reason is None else re.match(reason, result or "")


def test_a_hand_in_the_table_is_rejected(table_scene):
    def script(view):
        yield Stage("hover", left=GRASP.translated((0, 0, 0.1)), planned=True)
        yield Stage("down", left=GRASP.translated((0.1, 0, -0.07)))

    assert "collision" in (Rehearsal(table_scene).infeasibility(script) or "")


def test_a_planned_goal_inside_a_prop_is_rejected(table_scene):
    table_scene.place("wall", Pose.upright((0.2, 0.2, 0.915)))
    assert Rehearsal(table_scene).infeasibility(_pick_up) == "hover: no collision-free posture"


def test_postures_near_joint_limits_are_rejected(table_scene):
    def script(view):
        yield Stage("twist", left=view.tcp(Arm.LEFT) @ turn, planned=False)

    verdicts = []
    for angle in np.deg2rad(np.arange(0, 180, 15)):
        turn = Pose.upright((0, 0, 0), angle)
        verdicts.append(Rehearsal(table_scene).infeasibility(script))
    assert verdicts[0] is None
    assert any(verdict is not None for verdict in verdicts)


def test_one_infeasible_codec_among_several_is_enough(table_scene):
    used = Rehearsal(table_scene, [None, KeyposeCodec()])
    for shift_m in ((0, 0, 0), (0.25, 0.05, 0), (0.4, 0.2, 0), (0, 0, 0)):
        table_scene.place("block", Pose.upright(np.add((0.2, 0.2, 0.79), shift_m)))
        script = partial(_pick_up, above=GRASP.translated(shift_m))
        alone = [Rehearsal(table_scene, [codec]).infeasibility(script) for codec in (None, KeyposeCodec())]
        together = used.infeasibility(script)  # whatever was rehearsed before
        assert (together is None) == (alone == [None, None])
        assert together in alone


def test_a_prop_in_an_arm_or_right_beside_it_is_rejected(table_scene):
    link = table_scene.data.body("left_link5").xpos
    for outward_m, expected in ((0.0, "too close"), (0.6, "None")):
        table_scene.place("wall", Pose.upright(np.add(link, (0, outward_m, 0))))
        reason = Rehearsal(table_scene).infeasibility(lambda view: iter(()))
        assert str(reason).startswith(expected)
