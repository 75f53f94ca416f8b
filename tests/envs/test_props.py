"""What no model holds, things from files, and what meshes enclose."""

import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.meshes import SEGMENTS, lathe, slab
from lerobot_env_bimanual.props.model_file import ModelFile
from lerobot_env_bimanual.props.prop import COLLISION_ONLY
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene

TABLE = 0.75


@pytest.mark.parametrize("name", list_tasks())
def test_no_model_has_welds_mocap_bodies_plugins_extra_actuators_or_props_without_mass(name):
    model = Scene(get_task(name).spec.props).model
    fingers = {"left_fingers", "right_fingers"}
    assert {model.equality(index).name for index in range(model.neq)} == fingers
    assert np.all(model.eq_type == mujoco.mjtEq.mjEQ_JOINT)
    assert model.nmocap == 0
    assert model.nu == 16  # nothing but the arms is driven
    assert model.nplugin == 0
    robot = [model.body(index).name.startswith(("left_", "right_")) for index in range(model.nbody)]
    assert np.all(model.body_mass[(model.body_weldid != 0) & ~np.array(robot)] > 5e-4)


def test_a_thing_from_a_file_has_its_meshes_and_falls_onto_the_table(tmp_path):
    (tmp_path / "meshes").mkdir()
    corners, faces = "v 0 0 0\nv .05 0 0\nv 0 .05 0\nv 0 0 .05\n", "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "meshes/cup.obj").write_text(corners + faces)
    path = tmp_path / "cup.xml"
    asset = '<compiler meshdir="meshes"/><asset><mesh name="cup" file="cup.obj"/></asset>'
    body = '<body name="any" pos="1 1 1"><geom type="mesh" mesh="cup" mass="0.1" group="{}"/></body>'
    # MuJoCo's own tools show the first group, and not the second.
    for group, drawn in ((1, 0), (4, COLLISION_ONLY["group"])):
        path.write_text(f"<mujoco>{asset}<worldbody>{body.format(group)}</worldbody></mujoco>")
        model = Scene([ModelFile("cup", str(path))]).model
        assert model.geom_group[model.geom_bodyid == model.body("cup").id] == [drawn]
    scene = Scene([ModelFile("cup", str(path)), ModelFile("stand", str(path), is_free=False)])
    scene.place("cup", Pose.upright((0.25, -0.1, TABLE + 0.03)))
    scene.place("stand", Pose.upright((0.25, 0.2, TABLE)))
    scene.settle()
    assert scene.pose("cup").position[2] == pytest.approx(TABLE, abs=2e-3)
    assert scene.pose("stand").position == pytest.approx((0.25, 0.2, TABLE))
    path.write_text("<mujoco/>")
    with pytest.raises(BimanualError, match="has no body"):
        Scene([ModelFile("cup", str(path))])
    with pytest.raises(BimanualError, match=r"prop 'mug': /.*mug.xml: .*Error opening file"):
        Scene([ModelFile("mug", "mug.xml")])


def test_a_file_s_exclusions_and_constraints_may_name_its_first_body(tmp_path):
    (path := tmp_path / "pot.xml").write_text("""<mujoco><worldbody><body name="pot"><geom size=".03"/>
        <body name="lid"><joint name="turn"/><geom size=".03"/></body></body></worldbody>
        <contact><exclude body1="pot" body2="lid"/></contact>
        <equality><weld body1="lid" body2="pot"/><joint joint1="turn"/></equality></mujoco>""")
    others, model = Scene([]).model, Scene([ModelFile("mine", str(path))]).model
    assert (model.nexclude, model.neq) == (others.nexclude + 1, others.neq + 2)
    bodies = [model.body(name).id for name in ("mine_lid", "mine")]
    assert [*zip(model.eq_obj1id, model.eq_obj2id, strict=True)].count((*bodies,)) == 1


CYLINDER = [(0, -0.1), (0.2, -0.1), (0.2, 0.1), (0, 0.1)]
RING_FOOT = [(0, 0.01), (0.1, 0.01), (0.1, 0), (0.2, 0), (0.2, 0.1), (0, 0.1)]


def volume(vertices, faces):
    """Signed volume, positive if the faces look outwards."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.einsum("ni,ni->", a, np.cross(b, c)) / 6


def test_meshes_have_the_volume_of_their_profile_or_of_their_box_but_for_the_corners():
    circle = np.sin(2 * np.pi / SEGMENTS) * SEGMENTS / 2  # area of the polygon in the unit circle
    assert volume(*lathe(CYLINDER)) == pytest.approx(circle * 0.2**2 * 0.2)
    assert volume(*lathe(RING_FOOT)) == pytest.approx(circle * (0.2**2 * 0.1 - 0.1**2 * 0.01))
    for radius in (0.02, 0.2):
        vertices, faces = slab((0.3, 0.2, 0.01), radius)
        assert np.abs(vertices).max(axis=0) == pytest.approx((0.3, 0.2, 0.01))
        missing = (4 - np.pi) * radius**2
        assert volume(vertices, faces) == pytest.approx((0.6 * 0.4 - missing) * 0.02, rel=5e-3)
