"""Any input to an environment gives a transition, or one clear error that leaves everything as it was."""

import itertools
from dataclasses import fields
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import ControlMode, EnvOptions
from lerobot_env_bimanual.tasks.registry import list_tasks

pytestmark = pytest.mark.fuzz

SEED = 5
CASES = list(zip(list_tasks(), itertools.cycle(get_args(ControlMode)), strict=False))

ODD_NUMBERS = [np.nan, np.inf, -np.inf, 5e-324, 1e-40, 3.5e38, 1e308, -0.0]
NUMBERS = st.floats(-4, 4) | st.floats() | st.sampled_from(ODD_NUMBERS)
VECTORS = st.sampled_from([16, 18]).flatmap(lambda size: nps.arrays(np.float64, size, elements=NUMBERS))
DTYPES = nps.scalar_dtypes() | nps.unicode_string_dtypes() | nps.complex_number_dtypes()
SHAPES = st.sampled_from([(16,), (18,), (1, 16), (), (17,), (0,)]) | nps.array_shapes(max_dims=3, max_side=4)
WORDS = st.text(max_size=8) | st.binary(max_size=8)
JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | NUMBERS | st.complex_numbers() | WORDS,
    lambda inner: st.lists(inner, max_size=18) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=20,
)
ACTIONS = VECTORS | nps.arrays(DTYPES, SHAPES) | JUNK

PLAUSIBLE = {
    "variation": st.integers(-2, 6) | st.sampled_from(["any", "0", "1", "01", "²", "-1", "1.0"]),
    "split": st.sampled_from(["train", "val", "test", "dev"]),
    "cameras": st.lists(st.sampled_from(["front", "left_wrist", "top", " front", ""]), max_size=3)
    | st.sampled_from(["front,right_wrist", ",", "front,,front"]),
    "image_size": st.integers(-1, 5000)
    | st.tuples(st.integers(0, 5000), st.integers(0, 5000))
    | st.sampled_from(["24x32", "x", "24x", "1e3", "٣٢", "24x32x8"]),
    "obs": st.sampled_from(["rgbd", "rgb", "state", "RGB"]),
    "control_mode": st.sampled_from([*get_args(ControlMode), "ee"]),
    "video_dir": st.sampled_from(["films", "/dev/null/films", "", "a\0b", "/proc/1/films"]),
    "max_keyposes": st.integers(-1, 30),
    "render_quality": st.sampled_from(["observation", "high", "ultra"]),
}
OPTIONS = st.fixed_dictionaries({}, optional={name: value | JUNK for name, value in PLAUSIBLE.items()})
MISSPELT = st.dictionaries(st.text(max_size=12), JUNK, max_size=1)


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(case))
def environment(request, instant_placement):
    task, control_mode = request.param
    env = BimanualEnv(task, obs="state", control_mode=control_mode, max_keyposes=2)
    env.reset(seed=SEED)
    return env, env.save_state()


@given(actions=st.lists(ACTIONS, min_size=1, max_size=3))
def test_any_action_is_a_step_or_refused_without_a_trace(environment, actions):
    env, start = environment
    env.restore_state(start)
    for action in actions:
        before, ticks = env.state_hash(), env.progress.ticks
        try:
            observation, reward, terminated, truncated, info = env.step(action)
        except InvalidAction:
            assert (env.state_hash(), env.progress.ticks) == (before, ticks)
            continue
        assert env.observation_space.contains(observation)
        assert reward in (0.0, 1.0)
        assert terminated == bool(info["is_success"] or info["failure"])
        if terminated or truncated:
            break


@given(options=OPTIONS, misspelt=MISSPELT)
def test_any_options_make_an_environment_or_are_refused_and_write_nothing(
    options, misspelt, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    try:
        env = BimanualEnv("handover_item", **options | misspelt)
    except BimanualError:
        pass
    else:
        assert set(env.options.keywords()) == {field.name for field in fields(EnvOptions)}
        assert EnvOptions(**env.options.keywords()) == env.options
        assert env.action_space.contains(env.action_space.sample())
    assert not [*tmp_path.iterdir()]


SEEDS = st.none() | st.integers() | st.integers(0, 2**63) | NUMBERS | JUNK
RESET_NAMES = st.sampled_from(["variation", "variaton", "lerobot_new_rollout"])
RESET_OPTIONS = st.none() | st.dictionaries(RESET_NAMES, PLAUSIBLE["variation"] | JUNK) | JUNK


@given(seed=SEEDS, options=RESET_OPTIONS)
def test_any_arguments_of_reset_start_an_episode_or_are_refused(seed, options, resettable):
    before = resettable.state_hash()
    try:
        observation, info = resettable.reset(seed=seed, options=options)
    except BimanualError:
        assert resettable.state_hash() == before
        return
    assert resettable.observation_space.contains(observation)
    assert seed is None or info["seed"] == seed


@pytest.fixture(scope="module")
def resettable(instant_placement):
    env = BimanualEnv("handover_item_easy", obs="state")
    env.reset(seed=SEED)
    return env
