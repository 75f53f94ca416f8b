"""What a coupling meter says of hands that squeeze one thing, and of hands that do not."""

from dataclasses import astuple

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert import coupling as coupling_module
from lerobot_env_bimanual.expert.coupling import Coupling, CouplingMeter, mean_coupling, transmitted_force
from lerobot_env_bimanual.expert.runner import run_expert
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S

RADIUS_M = 0.16
"""Of a ball that is a little too wide for the distance between the hands at home."""
X, Z = np.eye(3)[[0, 2]]


@pytest.mark.parametrize(
    ("left_n", "right_n", "passed_n"),
    [
        (5 * X, -5 * X, 5.0),  # squeeze
        (-5 * X, 5 * X, 5.0),  # pull
        (5 * X, -2 * X, 2.0),  # squeeze, and 3 N more from one side
        (5 * X, 0 * X, 0.0),  # one pushes alone
        (5 * Z, 5 * Z, 0.0),  # both carry
        (5 * Z, 2 * Z, 0.0),  # both carry, one of them more
        (5 * X + 9 * Z, -5 * X + 9 * Z, 5.0),  # squeeze and carry
    ],
)
def test_the_force_between_the_hands_is_what_cancels(left_n, right_n, passed_n):
    assert transmitted_force(left_n, right_n) == pytest.approx(passed_n)
    assert transmitted_force(right_n, left_n) == pytest.approx(passed_n)


def test_the_force_between_the_hands_does_not_depend_on_the_axes():
    rng = np.random.default_rng(0)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    left_n, right_n = rng.normal(size=(2, 3))
    turned = transmitted_force(rotation @ left_n, rotation @ right_n)
    assert turned == pytest.approx(transmitted_force(left_n, right_n))


@pytest.fixture(scope="module")
def shared() -> Scene:
    return Scene([Ball(radius_m=RADIUS_M)])


@pytest.fixture
def scene(shared: Scene) -> Scene:
    shared.reset()
    return shared


def measure(scene: Scene, ticks: int = 0, turn_rad: tuple[float, float] = (0, 0)) -> Coupling:
    """Watch the scene while the arms turn in their bases by so much in all, at a constant speed."""
    meter, action = CouplingMeter(scene), scene.commanded
    meter.observe()
    for _ in range(ticks):
        action[[0, 8]] += np.array(turn_rad) / ticks
        scene.tick(action)
        meter.observe()
    return meter.result()


def between_hands(scene: Scene) -> Pose:
    return Pose.upright(np.mean([scene.tcp(arm).position for arm in Arm], axis=0))


def test_hands_that_squeeze_a_ball_pass_force(scene):
    scene.place("ball", between_hands(scene))
    assert all(scene.touching(arm, "ball") for arm in Arm)
    coupling = measure(scene)
    assert coupling.shared_object_s == pytest.approx(TICK_S)
    assert coupling.transmitted_force_mean_n == coupling.transmitted_force_peak_n > 10


def test_the_forces_of_the_hands_are_those_that_hold_the_ball(scene, monkeypatch):
    """The measured pair and gravity add up to what accelerates the ball: directions and signs are right."""
    noted = []
    monkeypatch.setattr(coupling_module, "transmitted_force", lambda *forces_n: noted.append(forces_n) or 0.0)
    scene.place("ball", between_hands(scene))
    measure(scene)
    ((left_n, right_n),) = noted
    ball = scene.model.body("ball")
    copied = mujoco.MjData(scene.model)
    mujoco.mj_copyData(copied, scene.model, scene.data)
    mujoco.mj_forward(scene.model, copied)
    acceleration = copied.qacc[ball.dofadr[0] : ball.dofadr[0] + 3]
    np.testing.assert_allclose(
        left_n + right_n, ball.mass * (acceleration - scene.model.opt.gravity), atol=1e-6
    )
    assert left_n[1] < -10  # the left hand is on the side of +y
    assert right_n[1] > 10


def test_a_ball_at_one_hand_is_not_shared(scene):
    away = np.array([0, RADIUS_M, 0])
    scene.place("ball", Pose.upright(scene.tcp(Arm.LEFT).position + away))
    assert scene.touching(Arm.LEFT, "ball")
    coupling = measure(scene)
    assert (coupling.shared_object_s, coupling.transmitted_force_peak_n) == (0, 0)


def test_measuring_changes_nothing(scene):
    def play(watched: bool) -> str:
        scene.reset()
        scene.place("ball", between_hands(scene))
        meter = CouplingMeter(scene)
        for _ in range(4):
            if watched:
                meter.observe()
            scene.tick(scene.commanded)
        return scene.state_hash()

    assert play(watched=True) == play(watched=False)


def test_hands_at_rest_have_no_synchrony(scene):
    coupling = measure(scene, ticks=2)
    assert coupling.both_moving_share == 0


def test_one_hand_alone_is_neither_synchronous_nor_symmetric(scene):
    coupling = measure(scene, ticks=10, turn_rad=(0.5, 0))
    assert coupling.both_moving_share == 0
    assert coupling.mirror_similarity == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(("right", "similarity"), [(0.5, 1.0), (-0.5, -1.0)])
def test_hands_that_part_are_mirror_images_and_hands_that_follow_are_the_opposite(scene, right, similarity):
    coupling = measure(scene, ticks=10, turn_rad=(0.5, right))
    assert coupling.both_moving_share > 0.8
    assert coupling.speed_correlation > 0.9
    assert coupling.mirror_similarity == pytest.approx(similarity, abs=0.25)


def test_nothing_observed_is_no_coupling(scene):
    assert set(astuple(CouplingMeter(scene).result())) == {0.0}


@pytest.mark.sim
@pytest.mark.parametrize(("task", "coupled"), [("lift_ball", True), ("dual_push_buttons", False)])
def test_an_expert_passes_force_where_both_hands_hold_one_thing(task, coupled):
    env = BimanualEnv(task, split="val", obs="state", control_mode="keypose")
    meters = []

    def listen(env, _) -> None:
        if not meters:
            meters.append(CouplingMeter(env.scene))
        meters[0].observe()

    env.tick_observers.append(listen)
    assert run_expert(env, 0).success
    coupling = meters[0].result()
    env.close()
    assert coupling.both_moving_share > 0.8
    assert (coupling.shared_object_s > 0.5) == coupled
    assert (coupling.transmitted_force_mean_n > 10) == coupled


def test_the_mean_coupling_is_taken_field_by_field():
    assert mean_coupling(
        [Coupling(0.0, 0.0, 0.0, 1.0, 1.0, 1.0), Coupling(2.0, 4.0, 6.0, 0.0, 0.0, 0.0)]
    ) == Coupling(1.0, 2.0, 3.0, 0.5, 0.5, 0.5)
