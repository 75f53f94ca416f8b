"""Each condition on a scene made by hand, on both sides of its limit."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual import conditions
from lerobot_env_bimanual.conditions import (
    Above,
    Always,
    AtRest,
    Condition,
    Held,
    Once,
    Pressed,
    Touched,
    Untouched,
    on_the_way,
    with_parts,
)
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.button import Button
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.world.scene import Scene


@dataclass(frozen=True)
class When(Condition):
    """A condition that a test decides."""

    label: str
    test: Callable[[], bool] = field(repr=False)

    def __call__(self, view) -> bool:
        return self.test()


HIGH_IN_THE_AIR = Pose.upright((0.25, 0.3, 1.2))


@pytest.fixture(scope="module")
def compiled_scene():
    return Scene([Target("target"), Block("item")])


@pytest.fixture
def scene(compiled_scene):
    compiled_scene.reset()
    compiled_scene.place("item", HIGH_IN_THE_AIR)
    return compiled_scene


def close(scene, arm):
    """Tick until the arm's hand has closed on whatever is in it, without gravity, for it would fall meanwhile."""
    action = scene.commanded
    action[8 * arm.ordinal + 7] = 0.0
    gravity = scene.model.opt.gravity.copy()
    scene.model.opt.gravity[:] = 0
    for _ in range(10):
        scene.tick(action)
    scene.model.opt.gravity[:] = gravity


def test_above_compares_the_height_of_the_origin(scene):
    assert Above("item", 1.199)(scene)
    assert not Above("item", 1.201)(scene)


CENTRED = conditions.CentredOn("item", "target", 0.05)
INSIDE = conditions.Inside("item", "target", (-0.1, -0.05, 0.0), (0.1, 0.05, 0.05))


@pytest.mark.parametrize(
    ("condition", "offset", "met"),
    [
        (CENTRED, (0.049, -0.049, 0.1), True),
        (CENTRED, (0.051, 0, 0.1), False),
        (CENTRED, (0, -0.051, 0.1), False),
        (INSIDE, (0.09, 0, 0.01), True),
        (INSIDE, (0.11, 0, 0.01), False),
        (INSIDE, (0, 0, -0.01), False),
    ],
)
def test_places_are_measured_in_the_axes_of_the_target(scene, condition, offset, met):
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


def test_conditions_on_the_way_remember_what_was(scene):
    now = {"a": False, "b": True}
    parts = tuple(When(name, lambda name=name: now[name]) for name in now)
    once, always = Once(parts), Always(parts)
    assert (once.name, always.name) == ("once(when(a) and when(b))", "always(when(a) or when(b))")
    assert [each.name for each in with_parts([once])] == [once.name, "when(a)", "when(b)"]
    met = on_the_way((once, always, *parts), scene, {})
    assert met == {once.name: False, always.name: True}
    history = []
    for now["a"], now["b"] in ((True, True), (True, False), (False, False), (True, True)):
        met = on_the_way((once, always), scene, met)
        history.append((met[once.name], met[always.name]))
    assert history == [(True, True), (True, True), (True, False), (True, False)]


def test_at_rest_is_about_speed(scene):
    assert AtRest("item")(scene)
    for _ in range(2):
        scene.tick(scene.commanded)
    assert scene.speed("item") > 0.3
    assert not AtRest("item")(scene)
    assert AtRest("item", speed_m_s=2.0)(scene)


@pytest.mark.parametrize("arm", ARMS)
def test_a_closed_hand_holds_and_touches_what_is_between_its_fingers(scene, arm):
    tcp = scene.tcp(arm)
    scene.place("item", Pose.looking(tcp.position, (0, 0, 1), tcp.rotation[:, 1]))
    close(scene, arm)
    assert Held("item", arm)(scene)
    assert Touched("item", arm)(scene)
    assert not Untouched("item", arm)(scene)
    assert not conditions.Unhandled(("target", "item"))(scene)
    assert conditions.Unhandled(("target",))(scene)
    assert not Held("item", arm.other)(scene)
    assert not Touched("item", arm.other)(scene)
    assert Untouched("item", arm.other)(scene)


def test_one_finger_touches_but_does_not_hold(scene):
    tcp = scene.tcp(Arm.LEFT)
    beside = tcp.position + tcp.rotation[:, 1] * 0.0205  # the pads stand 4 cm to either side
    scene.place("item", Pose.looking(beside, (0, 0, 1), tcp.rotation[:, 1]))
    assert Touched("item", Arm.LEFT)(scene)
    assert not Held("item", Arm.LEFT)(scene)


def test_a_forearm_is_part_of_the_arm_but_not_of_the_hand(scene):
    geom = scene.model.body("left_link5").geomadr[0]
    scene.place("item", Pose.upright(scene.data.geom_xpos[geom]))
    assert not Untouched("item", Arm.LEFT)(scene)
    assert not Touched("item", Arm.LEFT)(scene)


def test_a_button_is_pressed_while_its_cap_is_down_and_springs_back():
    scene = Scene([Button("button")])
    assert not Pressed("button")(scene)
    scene.set_joint("button_cap", -0.0011)
    assert Pressed("button")(scene)
    scene.settle()
    assert not Pressed("button")(scene)
    assert scene.joint_value("button_cap") == pytest.approx(0.0, abs=2e-4)
