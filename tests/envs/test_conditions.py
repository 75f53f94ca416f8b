"""Each condition on a scene made by hand, on both sides of its limit, and where props are placed."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle
from lerobot_env_bimanual import conditions
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.perturbations import Perturbations
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.button import Button
from lerobot_env_bimanual.props.laptop import Laptop
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.task import PlacementArea
from lerobot_env_bimanual.tasks.lift_ball import AREA, LiftBall
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.worlds import MAX_DRAWS, EpisodeReset


@dataclass(frozen=True)
class When(conditions.Condition):
    """A condition that a test decides."""

    label: str
    test: Callable[[], bool] = field(repr=False)

    def __call__(self, view) -> bool:
        return self.test()


HIGH_IN_THE_AIR = Pose.upright((0.25, 0.3, 1.2))


@pytest.fixture
def scene(scene_of):
    scene = scene_of(Target("target"), Block("item"))
    scene.place("item", HIGH_IN_THE_AIR)
    return scene


def test_wholly_above_includes_the_bodies_that_are_attached_to_a_prop():
    scene, lid_down = Scene([Laptop("laptop")]), (0.0, 1.0, 0.0, 0.0)
    scene.place("laptop", Pose(HIGH_IN_THE_AIR.position, lid_down))
    assert conditions.WhollyAbove("laptop", 1.187)(scene)
    assert not conditions.WhollyAbove("laptop", 1.19)(scene), (
        "the base's underside is at 1.192, the lid's at 1.187"
    )


CENTRED = conditions.CentredOn("item", "target", 0.05)
BOX_M = (-0.1, -0.05, 0.0), (0.1, 0.05, 0.05)
INSIDE = conditions.Inside("item", "target", *BOX_M)
NONE_INSIDE = conditions.NoneInside(("item",), "target", *BOX_M)


@pytest.mark.parametrize(
    ("condition", "offset", "met"),
    [
        (CENTRED, (0.049, -0.049, 0.1), True),
        (CENTRED, (0.051, 0, 0.1), False),
        (CENTRED, (0, -0.051, 0.1), False),
        (INSIDE, (0.09, 0, 0.01), True),
        (INSIDE, (0.11, 0, 0.01), False),
        (INSIDE, (0, 0, -0.01), False),
        (NONE_INSIDE, (0.09, 0, 0.01), False),
        (NONE_INSIDE, (0, 0, -0.01), True),
        (conditions.Above("item", 0.849), (0, 0, 0.1), True),
        (conditions.Above("item", 0.851), (0, 0, 0.1), False),
    ],
)
def test_places_are_measured_in_the_axes_of_the_target_and_heights_at_the_origin(
    scene, condition, offset, met
):
    target = Pose.upright((0.3, 0.1, 0.75), np.deg2rad(30))
    scene.place("target", target)
    scene.place("item", Pose.upright(target.apply(offset), 1.0))
    assert condition(scene) == met


def test_near_and_aligned_are_measured_from_where_and_how_things_were_placed(scene):
    scene.place("target", Pose.upright((0.3, 0.1, 0.75), np.deg2rad(170)))
    assert conditions.Near("item", 0.0)(scene)
    assert conditions.Raised("item", 0.0)(scene)
    assert not conditions.Raised("item", 0.001)(scene)
    scene.data.qpos[-7:-5] += (0.03, -0.04)  # not placed there
    scene.data.qpos[-4:] = Pose.upright((0, 0, 0), np.deg2rad(-179)).quat_wxyz
    scene.restore_state(scene.save_state())
    assert conditions.Near("item", 0.0501)(scene)
    assert not conditions.Near("item", 0.0499)(scene)
    assert conditions.Aligned("item", "target", 11.1)(scene)
    assert not conditions.Aligned("item", "target", 10.9)(scene)


def test_a_thing_is_tipped_while_it_leans_and_is_still_low(scene):
    scene.place("item", Pose(HIGH_IN_THE_AIR.position, quat_wxyz_from_axis_angle((0, 1, 0), np.deg2rad(15))))
    assert conditions.Tipped("item", 14.9, 0.06)(scene)
    assert not conditions.Tipped("item", 15.1, 0.06)(scene)
    for rise_m, is_low in ((0.059, True), (0.002, False)):
        scene.data.qpos[-5] += rise_m  # not placed there
        scene.restore_state(scene.save_state())
        assert conditions.Tipped("item", 14.9, 0.06)(scene) == is_low


def test_once_and_always_remember_earlier_ticks(scene):
    now = {"a": False, "b": True}
    parts = tuple(When(name, lambda name=name: now[name]) for name in now)
    once, always = conditions.Once(parts), conditions.Always(parts)
    assert (once.name, always.name) == ("once(when(a) and when(b))", "always(when(a) or when(b))")
    met = conditions.history_conditions((once, always, *parts), scene, {})
    assert met == {once.name: False, always.name: True}
    history = []
    for now["a"], now["b"] in ((True, True), (True, False), (False, False), (True, True)):
        met = conditions.history_conditions((once, always), scene, met)
        history.append((met[once.name], met[always.name]))
    assert history == [(True, True), (True, True), (True, False), (True, False)]


def test_at_rest_is_about_speed(scene):
    assert conditions.AtRest("item")(scene)
    for _ in range(2):
        scene.tick(scene.commanded)
    assert scene.speed("item") > 0.3
    assert not conditions.AtRest("item")(scene)
    assert conditions.AtRest("item", speed_m_s=2.0)(scene)


def test_one_finger_touches_without_holding_and_a_forearm_does_not_count_as_a_hand(scene):
    tcp = scene.tcp(Arm.LEFT)
    beside = tcp.position + tcp.rotation[:, 1] * 0.0205  # the pads are 4 cm to either side
    scene.place("item", Pose.looking(beside, (0, 0, 1), tcp.rotation[:, 1]))
    assert conditions.Touched("item", Arm.LEFT)(scene)
    assert not conditions.Held("item", Arm.LEFT)(scene)
    assert not conditions.Unhandled(("target", "item"))(scene)
    assert conditions.Unhandled(("target",))(scene)
    geom = scene.model.body("left_link5").geomadr[0]
    scene.place("item", Pose.upright(scene.data.geom_xpos[geom]))
    assert not conditions.Untouched("item", Arm.LEFT)(scene)
    assert not conditions.Touched("item", Arm.LEFT)(scene)


def test_a_button_is_pressed_while_its_cap_is_down_and_springs_back():
    scene = Scene([Button("button")])
    assert not conditions.Pressed("button")(scene)
    scene.set_joint("button_cap", -0.0011)
    assert conditions.Pressed("button")(scene)
    scene.settle()
    assert not conditions.Pressed("button")(scene)
    assert scene.joint_value("button_cap") == pytest.approx(0.0, abs=2e-4)


BOX = mujoco.mjtGeom.mjGEOM_BOX
AREA_WITH_YAW = PlacementArea(center_m=(0.2, -0.1), half_size_m=(0.1, 0.3), half_yaw_rad=0.5)


def test_samples_fill_the_area_and_stand_upright():
    rng = np.random.default_rng(0)
    poses = [AREA_WITH_YAW.sample(rng, height_m=0.8) for _ in range(500)]
    rotations = np.array([pose.rotation for pose in poses])
    yaw = [math.atan2(m[1, 0], m[0, 0]) for m in rotations]
    offsets = np.column_stack([[pose.position for pose in poses] - np.array((0.2, -0.1, 0.8)), yaw])
    assert np.abs(offsets).max(axis=0) == pytest.approx((0.1, 0.3, 0.0, 0.5), abs=0.01)
    assert (np.abs(offsets) <= (0.1, 0.3, 1e-12, 0.5)).all()
    assert np.allclose(rotations[:, 2, 2], 1)


class BallOutOfReach(LiftBall):
    """Draws legal placements, the first three of which no arm can serve."""

    good_from_draw = 4

    def place(self, scene, variation, rng):
        self.draws_so_far = getattr(self, "draws_so_far", 0) + 1
        super().place(scene, variation, rng)
        if self.draws_so_far < self.good_from_draw:
            scene.place("ball", scene.pose("ball").translated((2.0, 0.0, 0.0)))
        else:
            scene.place("ball", PlacementArea(AREA.center_m, (0.0, 0.0)).sample(rng, 0.9))
        return True


def beginning(task):
    return EpisodeProgress(0, task.spec.variations[0], "", np.random.default_rng(0))


def test_unreachable_placements_are_redrawn_and_counted_and_endless_redrawing_is_an_error():
    task = BallOutOfReach()
    scene, unchanged = Scene(task.spec.props), Perturbations("", task.spec, "test", CAMERA_NAMES)
    assert EpisodeReset(task, scene, unchanged).start(beginning(task)) == 4
    assert scene.pose("ball").position[:2] == pytest.approx(AREA.center_m, abs=1e-3)
    assert scene.ticks == 0
    task = get_task("lift_ball")
    task.place = lambda scene, variation, rng: False
    with pytest.raises(PlacementFailure, match=f"none of {MAX_DRAWS} .*{MAX_DRAWS}x illegal placement"):
        EpisodeReset(task, Scene(task.spec.props), unchanged).start(beginning(task))
    task.place = lambda scene, variation, rng: None
    with pytest.raises(BimanualError, match="`place` of lift_ball returned None, but must return True"):
        EpisodeReset(task, Scene(task.spec.props), unchanged).start(beginning(task))


@pytest.mark.parametrize("name", [name for name in list_tasks() if name.startswith("handover")])
def test_no_posture_of_the_receiving_arm_touches_what_is_to_be_handed_over(name):
    task, rng = get_task(name), np.random.default_rng(0)
    scene = Scene(task.spec.props)
    base = scene.arm_pair.base_pose(Arm.RIGHT).position
    reach_m = _reach_at_heights(scene, Arm.RIGHT, rng)
    for _ in range(20):
        assert task.place(scene, task.spec.variations[0], rng)
        for prop in task.spec.props:
            half = scene.model.geom(prop.name).size
            pose = scene.pose(prop.name)
            corners = pose.apply(np.array(list(product(*[(-1, 1)] * 3))) * half)
            nearest_m = np.linalg.norm((corners - base)[:, :2], axis=1).min()
            assert nearest_m > reach_m(pose.position[2] + half[2])


def _reach_at_heights(scene, arm, rng):
    """Return a function of a height: how far from the arm's base an open hand gets at or below this height.

    It is the greatest distance along the table over 25 000 stretched postures.
    """
    kinematics, base = scene.arm_pair.kinematics[arm], scene.arm_pair.base_pose(arm)
    joints = rng.uniform(kinematics.lower, kinematics.upper, (25_000, 7))
    joints[:, [0, 2]], joints[:, 4] = 0.0, rng.choice([0.0, 2.8], len(joints))
    joints[:, 1] = rng.uniform(0.8, kinematics.upper[1], len(joints))
    joints[:, 3] = rng.uniform(-1.0, kinematics.upper[3], len(joints))
    hands, _ = kinematics.poses_and_jacobians(joints)
    points = np.concatenate([hands[:, :3, :3] @ c + hands[:, :3, 3] for c in _hand_corners(scene, arm)])
    distance_m, height_m = np.linalg.norm(points[:, :2], axis=1), points[:, 2] + base.position[2]
    return lambda height: distance_m[(height_m >= base.position[2]) & (height_m <= height)].max()


def _hand_corners(scene, arm):
    """Corners (n, 3) of palm and open fingers in the frame of the tool centre point."""
    model, data, to_tcp = scene.model, scene.data, scene.tcp(arm).inverse()
    bodies = [model.body(n).id for n in (*scene.arm_pair.finger_names(arm), scene.arm_pair.hand_body(arm))]
    boxes = [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies and model.geom_type[g] == BOX]
    signs = np.array(list(product(*[(-1, 1)] * 3)))
    world = [
        data.geom_xpos[g] + (signs * model.geom_size[g]) @ data.geom_xmat[g].reshape(3, 3).T for g in boxes
    ]
    return to_tcp.apply(np.concatenate(world))
