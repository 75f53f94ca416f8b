"""Axes of observations and instructions leave the state as it is, and each changes only its own part."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_env_episodes import hash_sequence

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.perturbations.axis import HookContext, Start
from lerobot_env_bimanual.perturbations.scene import colour_name, named_colours, paraphrases
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

TASK = "dual_push_buttons"
SEED = 7
SEEN = tuple(name for name in AXES.names if AXES.get(name).changes_only_observations)
SAID = ("instruction", "sentences")
SHOWN = tuple(name for name in SEEN if name not in SAID)

DEPTH_TOO = ("camera_moved", "camera_miscalibrated", "depth_noise", "depth_holes", "fewer_cameras")
"""All others change colours alone."""
COLOURS_TOO = tuple(name for name in SHOWN if name not in ("depth_noise", "depth_holes"))
TOLD = ("camera_moved",)
"""All others leave the calibration as it was."""


def make(perturb: str = "", task: str = TASK, size: object = (24, 32)) -> BimanualEnv:
    return BimanualEnv(task, split="val", image_size=size, control_mode="joint", perturb=perturb)


def depths(observation: dict) -> list[np.ndarray]:
    return [observation[f"images.{camera}_depth"] for camera in CAMERA_NAMES]


def colours(observation: dict) -> list[np.ndarray]:
    return list(observation["pixels"].values())


def equal(some: list[np.ndarray], others: list[np.ndarray]) -> bool:
    return all(np.array_equal(one, other) for one, other in zip(some, others, strict=True))


@pytest.fixture(scope="module")
def as_it_is():
    env = make()
    hashes = hash_sequence(env, SEED, ticks=2)
    observation, instruction = env.observe(), env.task_description
    return hashes, observation, instruction


@pytest.mark.parametrize("axis", SEEN)
def test_an_axis_of_observations_changes_no_state_and_only_its_part_of_the_observation(axis, as_it_is):
    hashes, plain, instruction = as_it_is
    env = make(f"{axis}:3")
    assert hash_sequence(env, SEED, ticks=2) == hashes
    seen = env.observe()
    assert seen.keys() == plain.keys()
    assert env.observation_space.contains(seen)
    assert equal(depths(seen), depths(plain)) != (axis in DEPTH_TOO)
    assert equal(colours(seen), colours(plain)) != (axis in COLOURS_TOO)
    assert np.array_equal(seen["camera_extrinsics"], plain["camera_extrinsics"]) != (axis in TOLD)
    assert (env.task_description == instruction) != (axis in SAID)
    np.testing.assert_equal(env.observe(), seen, "two observations of one state differ")


def test_shadows_darken_something_and_leave_depth_alone():
    env = make("light:3", size=64)
    env.reset(seed=SEED)
    lit = env.observe()
    env.scene.appearance = replace(env.scene.appearance, casts_shadows=False)
    plain = env.observe()
    darkening = np.array(colours(plain), int) - np.array(colours(lit), int)
    assert np.mean(darkening > 20, axis=(1, 2, 3)).max() > 0.02
    assert equal(depths(lit), depths(plain))


def see(
    name: str,
    level: int,
    rgb: np.ndarray,
    depth_m: np.ndarray,
    seed: int = 0,
    cameras: tuple[str, ...] = CAMERA_NAMES,
) -> dict[str, Any]:
    """What an axis makes of an image at each camera, which are pinholes of 45 degrees here."""
    axis: Any = AXES.get(name)
    model = SimpleNamespace(camera=lambda _: SimpleNamespace(fovy=np.array([45.0])))
    world: Any = (SimpleNamespace(model=model), SimpleNamespace(memory={}))
    start, context = ((axis, axis.levels[level - 1], np.random.default_rng(seed + n), *world) for n in (0, 1))
    if axis.begin:
        axis.begin(Start(*start, task=None, cameras=cameras, is_feasible=lambda: True))  # type: ignore[arg-type]
    image = (rgb, depth_m.astype(np.float32))
    return {camera: axis.see(HookContext(*context), camera, tuple(map(np.copy, image))) for camera in cameras}


GREY = np.full((256, 256, 3), 128, np.uint8)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_noise_exposure_and_missing_cameras_are_as_strong_as_their_level_says(level):
    errors_m = [
        see("depth_noise", level, GREY, np.full((256, 256), distance_m))["front"][1] - distance_m
        for distance_m in (0.5, 1.0, 2.0)
    ]
    expected_m = AXES.get("depth_noise").levels[level - 1] * np.array([0.25, 1, 4])
    assert np.std(errors_m, axis=(1, 2)) == pytest.approx(expected_m, rel=0.03)
    assert np.mean(errors_m, axis=(1, 2)) == pytest.approx(0, abs=4e-4)
    stops = AXES.get("colour_noise").levels[level - 1]
    means, deviations = [], []
    for seed in range(6):
        rgb, depth_m = see("colour_noise", level, GREY, np.ones((256, 256)), seed)["front"]
        means.append(rgb.mean())
        deviations.append(rgb.std())
        assert (depth_m == 1).all()
    assert np.abs(np.log2(np.array(means) / 128)) * 2.2 == pytest.approx(stops, abs=0.05)
    assert len({mean > 128 for mean in means}) == 2
    assert np.array(deviations) == pytest.approx(12 * stops, rel=0.1)
    gone = set()
    for seed in range(30):
        shown = see("fewer_cameras", level, GREY, np.ones((256, 256)), seed)
        black = {camera for camera, (rgb, depth_m) in shown.items() if not rgb.any() and not depth_m.any()}
        whole = {camera for camera, (rgb, depth_m) in shown.items() if rgb.all() and depth_m.all()}
        assert (len(black), len(whole)) == (level, 5 - level)
        gone |= black
    assert gone == set(CAMERA_NAMES) - {"front"}


@pytest.mark.parametrize(
    ("cameras", "fails"), [(("front",), 0), (("left_wrist",), 0), (("left_wrist", "right_wrist"), 1)]
)
def test_at_least_one_camera_never_fails(cameras, fails):
    for seed in range(8):
        shown = see("fewer_cameras", 3, GREY, np.ones((256, 256)), seed, cameras)
        assert sum(not rgb.any() for rgb, _ in shown.values()) == fails


@pytest.mark.parametrize("level", [1, 2, 3])
def test_holes_are_beside_edges_on_dark_and_on_slanted_surfaces_and_nowhere_else(level):
    share = AXES.get("depth_holes").levels[level - 1]
    width = round(3 * share)

    def depth_of(rgb: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
        return see("depth_holes", level, rgb, depth_m)["front"][1][:, width:]

    flat = np.full((256, 256), 1.0)
    assert (depth_of(GREY, flat) == 1).all()
    dark = GREY.copy()
    dark[100:128] = round(60 * share) + 1
    dark[128:] = (*[round(60 * share)] * 2, 5)
    holes = depth_of(dark, flat) == 0
    assert holes[128:].all()
    assert not holes[:128].any()
    flat[:, 128:] = 1.5
    holes = depth_of(GREY, flat) == 0
    assert set(np.flatnonzero(holes.any(axis=0)) + width) == set(range(128, 128 + width))
    # Along any direction: an edge, and a plane at a slant s to the line of sight, whose depth z has a linear 1 / z.
    focal = 128 / math.tan(np.deg2rad(22.5))
    rows, columns = np.mgrid[:256, :256] - 127.5
    for towards_rad in np.deg2rad([0, 45, 90, 135, 200]):
        along = columns * math.cos(towards_rad) + rows * math.sin(towards_rad)
        holes = depth_of(GREY, np.where(along < 0, 1.0, 1.5)) == 0
        band = np.abs(along[:, width:]) < 1
        assert holes[width:][band[width:]].mean() > 0.3
        for slant_deg, is_lost in ((90 - 30 * share - 4, False), (90 - 30 * share + 4, True)):
            plane = 1 / (1 - along * math.tan(np.deg2rad(slant_deg)) / focal)
            assert (depth_of(GREY, np.where(plane > 0, plane, 1))[128, 128 - width] == 0) == is_lost


@pytest.mark.weekly
@pytest.mark.parametrize("task", list_tasks())
def test_things_whose_colour_is_named_keep_it_and_no_other_thing_gets_it(task):
    env = make("object_colour:3", task=task)
    named = named_colours(env.task_definition.spec)
    for seed in range(3):
        env.reset(seed=seed)
        model, worn = env.scene.model, env.scene.appearance.fields["geom_rgba"]
        arms = [model.body(env.scene.arm_pair.base_body(arm)).id for arm in ARMS]
        of_props = ~np.isin(model.body_rootid[model.geom_bodyid], [0, *arms])
        assert np.array_equal(worn[~of_props], model.geom_rgba[~of_props])
        has_own = of_props & (model.geom_matid < 0)
        for before, after in zip(model.geom_rgba[has_own], worn[has_own], strict=True):
            if colour_name(before[:3]) in named:
                assert np.array_equal(before, after)
            else:
                assert colour_name(after[:3]) not in named
        assert not np.array_equal(worn, model.geom_rgba)
        assert np.array_equal(worn[:, 3], model.geom_rgba[:, 3])


@pytest.mark.parametrize("task", paraphrases())
def test_paraphrases_are_distinct_and_new_and_name_what_every_instruction_names(task):
    spec, templates = get_task(task).spec, [*itertools.chain(*paraphrases()[task].values())]
    for variation in spec.variations:
        nominal = spec.instructions_for(variation)
        sentences = [template.format(**variation.words) for template in templates]
        texts = [*nominal, *sentences]
        assert len({text.lower().strip(" .?!") for text in texts}) == len(texts)
        verbs = {template.split()[0] for template in paraphrases()[task]["1"]}
        assert not verbs.intersection(" ".join(paraphrases()[task]["training"]).split())
        needed = [word for word in variation.words.values() if all(word in text for text in nominal)]
        assert all(word in sentence for word in needed for sentence in sentences)
