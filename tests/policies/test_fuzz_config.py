"""Whatever stands in a config, in a processor file or in weights: it is understood, or one line says what is wrong."""

import dataclasses
import json
from collections.abc import Callable
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import make_pre_post_processors
from safetensors.torch import save

from lerobot_bimanual.errors import BimanualError
from lerobot_policy_bimanual import configurations
from lerobot_policy_bimanual.checkpoint.config_file import read_config
from lerobot_policy_bimanual.checkpoint.processors import POSTPROCESSOR, PREPROCESSOR, check_processors
from lerobot_policy_bimanual.keypose.weights import check_weights

pytestmark = pytest.mark.fuzz

CONFIGS = [getattr(configurations, name) for name in configurations.__all__]
OF_LEROBOT = {field.name for field in dataclasses.fields(PreTrainedConfig)}
OURS = sorted({field.name for kind in CONFIGS for field in dataclasses.fields(kind)} - OF_LEROBOT)

plain = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
plain |= st.sampled_from([0, -1, 10**400, float("nan"), "learned", "clip:", "dense", "front", "IDENTITY"])
values = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
)


def attempt[T](work: Callable[..., T], *arguments: Any, **options: Any) -> T | None:
    """What some work gives, or None where it ends in an error of ours, which must be one line."""
    try:
        return work(*arguments, **options)
    except BimanualError as error:
        said = str(error)
    assert said
    assert len(said) < 10_000
    assert "\n" not in said
    return None


@given(st.sampled_from(CONFIGS), st.dictionaries(st.sampled_from(OURS), values, min_size=1, max_size=3))
def test_any_values_make_a_config_or_one_line(kind, changes: dict[str, Any]):
    known = {field.name for field in dataclasses.fields(kind)}
    fitting = {name: value for name, value in changes.items() if name in known}
    if (config := attempt(kind, device="cpu", **fitting)) is not None:
        assert config.codec.bins.voxels == config.voxel_size
        config.get_optimizer_preset()
        config.get_scheduler_preset()


def sound_files() -> dict[str, str]:
    """A config and its processor files as LeRobot writes them, by name."""
    config = configurations.PerAct2Config(device="cpu", keypose_horizon=8)
    pipelines = zip((PREPROCESSOR, POSTPROCESSOR), make_pre_post_processors(config), strict=True)
    steps = {name: json.dumps(pipeline.get_config()) for name, pipeline in pipelines}
    fields = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    fields["normalization_mapping"] = {key: mode.value for key, mode in config.normalization_mapping.items()}
    return {"config.json": json.dumps({"type": "peract2"} | fields)} | steps


SOUND = sound_files()
ALLOWED = {name: json.loads(SOUND[name])["steps"] for name in (PREPROCESSOR, POSTPROCESSOR)}


@st.composite
def damaged(draw: st.DrawFn, sound: bytes) -> bytes:
    """Bytes of a sound file with some changed, or with another value somewhere, or none of it."""
    kind = draw(st.sampled_from(["bytes", "cut", "flip", "value"]))
    if kind == "bytes":
        return draw(st.binary(max_size=40))
    if kind == "cut":
        return sound[: draw(st.integers(0, len(sound)))]
    if kind == "flip":
        at = draw(st.integers(0, len(sound) - 1))
        return sound[:at] + draw(st.binary(max_size=3)) + sound[at + 1 :]
    try:
        tree = json.loads(sound)
    except ValueError:
        return draw(st.binary(max_size=40)) + sound
    node: Any = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = draw(st.sampled_from(keys)) if keys else None
        if key is None or not isinstance(node[key], dict | list) or draw(st.booleans()):
            break
        node = node[key]
    if key is not None:
        node[key] = draw(values)
    return json.dumps(tree).encode()


@given(data=st.data())
def test_any_config_file_is_read_or_one_line(data, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    (folder / "config.json").write_bytes(data.draw(damaged(SOUND["config.json"].encode())))
    config = attempt(read_config, folder)
    assert config is None or isinstance(config, PreTrainedConfig)


@given(data=st.data(), name=st.sampled_from([PREPROCESSOR, POSTPROCESSOR]), ours=st.booleans())
def test_any_processor_file_is_read_or_one_line(data, name, ours, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    for sound in (PREPROCESSOR, POSTPROCESSOR):
        (folder / sound).write_text(SOUND[sound])
    (folder / name).write_bytes(data.draw(damaged(SOUND[name].encode())))
    if (steps := attempt(check_processors, folder, ALLOWED if ours else None)) is not None:
        assert all(isinstance(step, str) for names in steps.values() for step in names)
        if ours:
            assert steps == {file: [step["registry_name"] for step in ALLOWED[file]] for file in ALLOWED}


@given(data=st.data())
def test_any_file_of_weights_is_read_or_one_line(data, tmp_path_factory):
    tensors = {"a": torch.ones(2, 3), "b": torch.zeros(4)}
    file = tmp_path_factory.getbasetemp() / "model.safetensors"
    file.write_bytes(data.draw(damaged(save(tensors))))
    if (count := attempt(check_weights, file, tensors)) is not None:
        assert (count.tensors, count.parameters) == (2, 10)
