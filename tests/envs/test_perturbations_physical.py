"""Axes of perturbation: each changes one property of an episode, which stays reproducible."""

import hashlib
import pickle
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_env_bimanual.conditions import Inside
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.baselines import make_player
from lerobot_env_bimanual.experts.load import run_measured
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.perturbations.bodies import free_bodies
from lerobot_env_bimanual.props.prop import DISTRACTOR
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.sweep.conditions import conditions_of
from lerobot_env_bimanual.worlds import CODECS

PHYSICAL = [name for name in AXES.names if not AXES.get(name).changes_only_observations]
SEEN = [pytest.param(name, marks=pytest.mark.slow) for name in AXES.names if name not in PHYSICAL]
LEVELS = range(1, MAX_LEVEL + 1)
TICKS = 20
"""Enough for a perturbation that happens once, and for late commands."""
TASKS_OF_AXES = ("handover_item_easy", "put_item_in_drawer")
"""Every axis applies to at least one of them; some axes need free bodies or joints."""
MAX_SHIFT_M = 0.05


def make(task: str, axis: str = "", level: int = 3) -> BimanualEnv:
    obs = "rgbd" if axis and axis not in PHYSICAL else "state"
    perturb = f"{axis}:{level}" if axis else ""
    return BimanualEnv(task, obs=obs, image_size=(24, 32), split="val", perturb=perturb)


@pytest.fixture(scope="module")
def shared() -> Callable[..., BimanualEnv]:
    """Environments that several tests play in, one after the other."""
    return cache(make)


def wiggle(seed: int, ticks: int = TICKS) -> np.ndarray:
    """Joint actions (ticks, 16) relative to where the arms stand."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(-0.01, 0.01, (ticks, 16)), axis=0).astype(np.float32)


def hashes(env: BimanualEnv, moves: np.ndarray, start: np.ndarray) -> list[str]:
    """State, observation and instruction after each tick."""
    found = []
    for move in moves:
        observation, *_ = env.step(start + move)
        arrays = [*observation.pop("pixels", {}).values(), *observation.values()]
        seen = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
        found.append(env.state_hash() + seen + env.task_description)
    return found


@cache
def task_of(axis: str) -> str:
    applying = (conditions_of(task, AXES.names).not_applicable for task in TASKS_OF_AXES)
    return next(task for task, others in zip(TASKS_OF_AXES, applying, strict=True) if axis not in others)


@pytest.mark.parametrize("axis", [*PHYSICAL, *SEEN])
def test_levels_of_an_axis_share_what_a_seed_draws_and_lead_to_different_episodes(axis, shared):
    task, drawn, places_m, worlds, said = task_of(axis), [], [], set(), set()
    for level in (0, *LEVELS):
        env = shared(task, axis, level)
        env.reset(seed=5)
        said.add(env.task_description)
        progress = env.progress
        drawn.append((progress.variation, progress.draws, progress.rng.bit_generator.state))
        places_m.append([env.scene.pose(prop.name).position for prop in env.task_definition.spec.props])
        worlds.add(hashes(env, wiggle(1), env.scene.commanded)[-1])
    assert drawn == 4 * drawn[:1]
    assert np.linalg.norm(np.subtract(places_m, places_m[0]), axis=-1).max() < MAX_SHIFT_M
    # Of several sentences a seed may draw the same at two levels.
    assert len(worlds) == (len(said) if axis == "sentences" else 4)


@pytest.mark.parametrize("axis", [*PHYSICAL, *SEEN])
def test_a_perturbed_episode_is_the_same_in_any_environment_and_after_any_other_episode(axis, shared):
    fresh, env, moves = make(task_of(axis), axis), shared(task_of(axis), axis, 3), wiggle(2)
    fresh.reset(seed=3)
    start = fresh.scene.commanded
    before, copied = hashes(fresh, moves[:7], start), make(task_of(axis), axis)
    copied.restore_state(pickle.loads(pickle.dumps(fresh.save_state())))
    assert copied.scene.scales == fresh.scene.scales
    after = hashes(copied, moves[7:], start)  # with late commands pending, and before what happens once

    env.reset(seed=4)  # another episode, left in the middle
    hashes(env, moves[:7], start)
    env.reset(seed=3)
    assert hashes(env, moves[:7], start) == before
    half = env.save_state()
    assert hashes(env, moves[7:], start) == after
    env.reset(seed=4)
    env.restore_state(half)
    assert hashes(env, moves[7:], start) == after


def test_a_nudge_meets_keyposes_and_the_joint_actions_that_execute_them_alike():
    env, told = make("lift_ball", "nudge"), []
    with env.observed_by(lambda _, action: told.append(action.copy())):
        outcome = run_episode(env, 0, expert())
    env.reset(seed=0)
    for action in told:
        env.step(action)
    assert env.state_hash() == outcome.state_hash


def test_demonstrations_under_a_nudge_come_from_the_replanning_expert(shared):
    env = shared("handover_item_easy", "nudge", 3)
    assert not run_episode(env, 0, expert(), variation=0).success  # it read the scene once
    looks_again = run_episode(env, 0, make_player("replanning", 0), variation=0)
    outcome, episode = Recorder().record(env.task, env.options, 0, 0)
    assert episode is not None
    assert outcome == looks_again


def test_a_nudge_of_larger_props_leaves_the_task_feasible():
    env = BimanualEnv("pick_laptop", obs="state", control_mode="joint", perturb="nudge:3,size:3")
    env.reset(seed=0)
    stay = env.scene.commanded
    while not env.progress.disturbances:
        env.step(stay)
    script = env.task_definition.script_for_plan(env.progress.variation)
    assert Rehearsal(env.scene, CODECS).infeasibility(script) is None


@pytest.mark.slow
@pytest.mark.parametrize("plan", [0, 1])
def test_demonstrations_by_a_plan_look_again_after_a_nudge(shared, plan):
    env, usual = shared("lift_tray", "nudge", 2), shared("lift_tray")
    (nudged, _), (plain, _) = (
        Recorder().record(each.task, each.options, 1, 0, plan=plan) for each in (env, usual)
    )
    assert nudged.success
    assert len(nudged.moves) > len(plain.moves)


def test_hands_miss_the_first_keypose_and_reach_the_second_with_unchanged_commands(shared):
    env = shared("push_box", "misses", 2)
    outcome, plain = (run_measured(each, 0, expert()) for each in (env, shared("push_box")))
    for found in (outcome, plain):  # of what the arms were sent, which goes on from where they missed
        assert found.load is not None
        assert max(found.load.acceleration, found.load.jerk) < 0.6
    first, second, *_ = ([move.left_error_mm, move.right_error_mm] for move in outcome.moves)
    assert outcome.success
    assert min(first) > 3
    assert max(first) < 50
    assert max(second) < 3
    assert outcome.commands[:2] == plain.commands[:2]
    assert env.progress.clipped_ticks == 0


def test_distractors_lie_on_the_table_apart_from_everything_and_out_of_the_hands_way(shared):
    env = shared("handover_item", "clutter")
    env.reset(seed=0)
    scene, props = env.scene, env.task_definition.spec.props
    names = [scene.model.body(body).name for body in range(scene.model.nbody)]
    places = {name: scene.pose(name).position for name in names if name.startswith(DISTRACTOR)}
    lying = {name: place for name, place in places.items() if place[2] > TABLE_HEIGHT_M}
    assert lying
    assert not any(scene.contacts(name, prop.name) for name in lying for prop in props)
    assert run_episode(env, 0, expert()).success
    for name, place in lying.items():
        assert np.linalg.norm(scene.pose(name).position - place) < 1e-3


def test_friction_changes_every_contact_by_the_same_factor(shared):
    found = []
    for condition in ((), ("friction", 3)):
        env = shared(TASKS_OF_AXES[0], *condition)
        env.reset(seed=1)
        env.scene.place("item", env.scene.pose("item"))  # which wakes it
        found.append(env.scene.data.contact.friction.copy())
    plain, slippery = found
    assert len(plain)
    assert slippery == pytest.approx(plain * AXES.get("friction").levels[-1])


def test_a_larger_pan_holds_what_lies_at_its_side(shared):
    env = shared("sweep_to_dustpan", "size", 3)
    env.reset(seed=0)
    pan, box = (
        env.scene.pose("dustpan"),
        next(each for each in env.task_definition.spec.success if isinstance(each, Inside)),
    )
    for x_m, is_inside in ((0.1375, True), (0.14, False)):
        env.scene.place(box.prop, Pose(pan.apply((x_m, 0.0, 0.02)), pan.quat_wxyz))
        assert box(env.scene) == is_inside


def test_size_changes_extents_and_moments_of_what_moves_freely_and_nothing_else(shared):
    plain, larger = (shared("pick_plate", *condition).scene.model for condition in ((), ("size", 3)))
    factor, bodies = AXES.get("size").levels[-1], free_bodies(plain)
    for values, per_body, expected in (
        ("geom_aabb", plain.geom_bodyid, factor),
        ("body_inertia", np.arange(plain.nbody), factor**2),
        ("body_mass", np.arange(plain.nbody), 1.0),
    ):
        factors = np.where(bodies, expected, 1.0)[per_body]
        before, after = (getattr(model, values) for model in (plain, larger))
        scaled = (before.T * factors).T
        assert after == pytest.approx(scaled, rel=1e-6, abs=1e-9), values
