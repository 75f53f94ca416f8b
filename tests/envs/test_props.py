"""What things weigh, how they slide, spring and shut, and what their meshes enclose."""

import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.props.dustpan import Crumb, Dustpan
from lerobot_env_bimanual.props.fridge import Fridge
from lerobot_env_bimanual.props.meshes import lathe, slab
from lerobot_env_bimanual.props.model_file import ModelFile
from lerobot_env_bimanual.props.plate import Plate
from lerobot_env_bimanual.props.rope import Rope
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene

TABLE = 0.75


@pytest.mark.parametrize("name", list_tasks())
def test_no_model_welds_attaches_or_teleports_anything_or_holds_things_without_mass(name):
    model = Scene(get_task(name).spec.props).model
    fingers = {"left_fingers", "right_fingers"}
    assert {model.equality(index).name for index in range(model.neq)} == fingers
    assert np.all(model.eq_type == mujoco.mjtEq.mjEQ_JOINT)
    assert model.nmocap == 0
    assert model.nu == 16  # nothing but the arms is driven
    assert model.nplugin == 0
    robot = [model.body(index).name.startswith(("left_", "right_")) for index in range(model.nbody)]
    assert np.all(model.body_mass[(model.body_weldid != 0) & ~np.array(robot)] > 5e-4)


def travel_m(scene: Scene, body: str, force_n: float, ticks: int) -> float:
    """How far a force along y moves a body."""
    start = scene.pose(body).position
    push = scene.data.body(body).xfrc_applied
    push[1] = force_n
    for _ in range(ticks):
        scene.tick(scene.commanded)
    push[1] = 0.0
    return float(np.linalg.norm(scene.pose(body).position - start))


def test_a_thing_from_a_file_has_its_meshes_and_falls_onto_the_table(tmp_path):
    (tmp_path / "meshes").mkdir()
    corners, faces = "v 0 0 0\nv .05 0 0\nv 0 .05 0\nv 0 0 .05\n", "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "meshes/cup.obj").write_text(corners + faces)
    path = tmp_path / "cup.xml"
    asset = '<compiler meshdir="meshes"/><asset><mesh name="cup" file="cup.obj"/></asset>'
    body = '<body name="any" pos="1 1 1"><geom type="mesh" mesh="cup" mass="0.1"/></body>'
    path.write_text(f"<mujoco>{asset}<worldbody>{body}</worldbody></mujoco>")
    scene = Scene([ModelFile("cup", str(path)), ModelFile("stand", str(path), is_free=False)])
    scene.place("cup", Pose.upright((0.25, -0.1, TABLE + 0.03)))
    scene.place("stand", Pose.upright((0.25, 0.2, TABLE)))
    scene.settle()
    assert scene.pose("cup").position[2] == pytest.approx(TABLE, abs=2e-3)
    assert scene.pose("stand").position == pytest.approx((0.25, 0.2, TABLE))
    path.write_text("<mujoco/>")
    with pytest.raises(BimanualError, match="has no body"):
        Scene([ModelFile("cup", str(path))])


def test_a_hundred_and_eighty_newtons_leave_the_box_and_two_hundred_and_twenty_move_it():
    scene = Scene([Box()])
    assert scene.model.body("box").mass[0] == pytest.approx(50.0)  # as in the paper
    moved_m = []
    for force_n in (180.0, 220.0):
        scene.reset()
        scene.place("box", Pose.upright((0.25, -0.1, TABLE + 0.0645)))
        scene.settle()
        moved_m.append(travel_m(scene, "box", force_n, ticks=10))
    assert moved_m[0] < 1e-3
    assert moved_m[1] > 0.02


def test_ball_and_plate_are_slippery_against_everything_and_the_ball_lies_still():
    scene = Scene([Ball()])
    scene.place("ball", Pose.upright((0.25, -0.05, TABLE + 0.1499)))
    assert [contact.friction[0] for contact in scene.data.contact] == pytest.approx([0.3])
    scene.settle()
    for _ in range(20):
        scene.tick(scene.commanded)
    assert scene.speed("ball") < 1e-4
    assert scene.pose("ball").position == pytest.approx((0.25, -0.05, 0.90), abs=1e-3)
    for prop, friction in ((Ball(), 0.3), (Plate(), 0.35)):
        model = Scene([prop]).model
        felt = (model.geom_bodyid == model.body(prop.name).id) & (model.geom_contype > 0)
        assert np.all(model.geom_priority[felt] > model.geom("left_pad1").priority[0])
        assert model.geom_friction[felt, 0] == pytest.approx(friction)


def test_the_door_of_the_fridge_is_shut_half_a_second_after_it_was_let_go():
    scene = Scene([Fridge()])
    scene.place("fridge", Pose.upright((0.667, 0.292, TABLE), np.deg2rad(45)))
    scene.set_joint("fridge_hinge", np.deg2rad(80))
    for _ in range(10):
        scene.tick(scene.commanded)
    assert scene.joint_value("fridge_hinge") < np.deg2rad(5)
    for _ in range(5):
        scene.tick(scene.commanded)
    assert abs(scene.joint_value("fridge_hinge")) < np.deg2rad(1)


def test_the_target_touches_nothing():
    scene = Scene([Target(), Block()])
    scene.place("target", Pose.upright((0.25, 0.1, TABLE)))
    scene.place("item", Pose.upright((0.25, 0.1, TABLE + 0.0399)))
    assert scene.contacts("world", "item")
    assert not scene.contacts("target", "item")
    assert scene.pose("item").position[2] == pytest.approx(TABLE + 0.04, abs=5e-4)


def test_an_end_of_the_stretched_rope_returns_by_more_than_five_centimetres():
    rope = Rope("rope")
    scene = Scene([rope])
    scene.place("rope", Pose.upright((0.25, 0.1, TABLE + rope.knot_radius_m)))
    scene.settle()

    def length_m() -> float:
        return float(np.linalg.norm(scene.pose(rope.tail).position - scene.pose(rope.head).position))

    slack_m = length_m()
    for held in ((rope.tail, rope.head), (rope.head,)):  # both pull, then one lets go
        for _ in range(20):
            along = scene.pose(rope.head).position - scene.pose(rope.tail).position
            along *= 6.0 / np.linalg.norm(along)
            scene.data.body(rope.tail).xfrc_applied[:3] = -along if rope.tail in held else 0.0
            scene.data.body(rope.head).xfrc_applied[:3] = along if rope.tail in held else 0.0
            scene.tick(scene.commanded)
        if rope.tail in held:
            assert length_m() > slack_m + 0.07
    assert length_m() < slack_m + 0.01


def test_less_than_the_weight_of_one_crumb_pushes_the_dustpan_away():
    scene = Scene([Dustpan("dustpan"), Crumb("crumb")])
    scene.place("crumb", Pose.upright((0.25, 0.2, TABLE + 0.015)))
    weight_n = 9.81 * scene.model.body("crumb").mass[0]
    for share, moves in ((0.4, False), (0.8, True)):
        scene.place("dustpan", Pose.upright((0.25, -0.2, TABLE)))
        scene.settle()
        assert (travel_m(scene, "dustpan", -share * weight_n, ticks=20) > 0.02) == moves


CYLINDER = [(0, -0.1), (0.2, -0.1), (0.2, 0.1), (0, 0.1)]
RING_FOOT = [(0, 0.01), (0.1, 0.01), (0.1, 0), (0.2, 0), (0.2, 0.1), (0, 0.1)]


def volume(vertices, faces):
    """Signed volume, positive if the faces look outwards."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.einsum("ni,ni->", a, np.cross(b, c)) / 6


def test_meshes_have_the_volume_of_their_profile_or_of_their_box_but_for_the_corners():
    assert volume(*lathe(CYLINDER, segments=400)) == pytest.approx(np.pi * 0.2**2 * 0.2, rel=1e-3)
    hollow = np.pi * 0.2**2 * 0.1 - np.pi * 0.1**2 * 0.01
    assert volume(*lathe(RING_FOOT, segments=400)) == pytest.approx(hollow, rel=1e-3)
    for radius in (0.02, 0.2):
        vertices, faces = slab((0.3, 0.2, 0.01), radius)
        assert np.abs(vertices).max(axis=0) == pytest.approx((0.3, 0.2, 0.01))
        missing = (4 - np.pi) * radius**2
        assert volume(vertices, faces) == pytest.approx((0.6 * 0.4 - missing) * 0.02, rel=5e-3)
