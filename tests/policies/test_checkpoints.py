"""A checkpoint is data: nothing that it names runs, and what is missing, damaged or unknown is named in one line."""

import contextlib
import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from corruptions import Change
from corruptions import json_file as edit
from hypothesis import given
from hypothesis import strategies as st
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.factory import make_pre_post_processors
from lerobot.processor import ProcessorStepRegistry
from safetensors.torch import load_file, save_file

from lerobot_bimanual import cli
from lerobot_bimanual.errors import BimanualError
from lerobot_policy_bimanual.checkpoint.check import SAFE_POLICIES, check_checkpoint
from lerobot_policy_bimanual.checkpoint.steps import SAFE_STEPS, UnverifiableCheckpoint, step_names
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.inspection.loading import load_policy

CONFIG, WEIGHTS = "config.json", "model.safetensors"
PREPROCESSOR, POSTPROCESSOR = "policy_preprocessor.json", "policy_postprocessor.json"
BIAS = "network.stem.conv.bias"
FRONT = "observation.images.front"
FAR = {"type": "ACTION", "shape": [10**12]}
HUGE = {"type": "VISUAL", "shape": [3, 2**14, 2**14]}
ABSURD = b'{"a":{"dtype":"F32","shape":[0,9223372036854775808],"data_offsets":[0,0]}}'
FLOAT8 = torch.float8_e4m3fn


@pytest.fixture(scope="module")
def sound(save_policy, tmp_path_factory: pytest.TempPathFactory, tiny: dict[str, Any]) -> Path:
    return save_policy("peract2", tiny, tmp_path_factory.mktemp("sound"))


@pytest.fixture
def checkpoint(sound: Path, tmp_path: Path) -> Path:
    """A sound checkpoint to damage."""
    return Path(shutil.copytree(sound, tmp_path / "pretrained_model"))


def config(**changes: Any) -> Change:
    return edit(CONFIG, lambda value: value.update(changes))


def step(index: int = 0, **changes: Any) -> Change:
    """Change a step of the preprocessor."""
    return edit(PREPROCESSOR, lambda value: value["steps"][index].update(changes))


def weights(change: Callable[[dict[str, torch.Tensor]], Any]) -> Change:
    def damage(folder: Path) -> None:
        tensors = load_file(folder / WEIGHTS)
        change(tensors)
        save_file(tensors, folder / WEIGHTS)

    return damage


def write(name: str, content: bytes) -> Change:
    return lambda folder: (folder / name).write_bytes(content)


def remove(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


DAMAGES: dict[str, tuple[Change, str]] = {
    "unknown policy": (config(type="stranger"), "the policy 'stranger' loads language_encoder="),
    "language too wide for any memory": (config(language_dim=10**9), "language_dim is 1000000000"),
    "normalisation from outside": (config(normalization_mapping={"VISUAL": "MEAN_STD"}), "must be IDENTITY"),
    "an adapter": (config(use_peft=True), "an adapter loads its base by name.*--trust_checkpoint=true"),
    "too deep": (write(CONFIG, b"[" * 10**6), "maximum recursion depth"),
    "a config without end": (write(CONFIG, b" " * (2**26 + 1)), "exceeds the limit of 65536 kB"),
    "no config": (remove(CONFIG), "no checkpoint at"),
    "no weights": (remove(WEIGHTS), "model.safetensors is not a valid safetensors file .missing"),
    "weights from a pipe": (
        lambda folder: [(folder / WEIGHTS).unlink(), os.mkfifo(folder / WEIGHTS)],
        "model.safetensors is not a valid safetensors file .missing",
    ),
    "pickled weights": (write(WEIGHTS, pickle.dumps({"network": [1, 2]})), "not a valid safetensors file"),
    "a tensor missing": (weights(lambda tensors: tensors.pop(BIAS)), f"lacks tensors.*{BIAS}"),
    "a tensor too many": (weights(lambda tensors: tensors.update(more=torch.ones(1))), "unknown.* more"),
    "a tensor of another shape": (weights(lambda held: held.update({BIAS: torch.ones(9)})), r"is \(9,\)"),
    "a tensor of whole numbers": (
        weights(lambda held: held.update({BIAS: held[BIAS].long()})),
        "torch.int64",
    ),
    "an infinite weight": (weights(lambda held: held[BIAS][:1].fill_(torch.inf)), f"{BIAS} in .* not finite"),
    "no preprocessor": (remove(PREPROCESSOR), "policy_preprocessor.json: No such file"),
    "a step by class": (step(**{"class": "subprocess.Popen"}), "names the class 'subprocess.Popen'"),
    "an unknown step": (step(registry_name="stranger"), "the step 'stranger' may load something"),
    "another step of LeRobot": (step(registry_name="to_batch_processor", config={}), "but must list"),
    "a state file outside": (step(state_file="../secret.safetensors"), "state_file: .* pattern"),
    "a state file without end": (step(state_file="a" * 5000), "state_file: .* pattern"),
    "a tower by name": (config(language_encoder="clip:/none"), "loads language_encoder='clip:/none'"),
    "an unknown option": (step(config={"tokenizer": "evil"}), "loads tokenizer='evil' by name"),
    "a device of any text": (step(2, config={"device": "rm -rf"}), "device: .* pattern"),
    "a feature too large": (
        step(3, config={"eps": 1.0, "features": {"a": FAR}, "norm_map": {}}),
        "features.a.shape.0: .* less than",
    ),
    "an output too large": (config(output_features={"action": FAR}), "shape.0: .* less than"),
    "an image too large": (config(input_features={FRONT: HUGE}), "shape: must have at most"),
    "an odd shape": (config(input_features={FRONT: {"type": "VISUAL", "shape": "x"}}), "shape: .* is 'x'"),
    "more beside the steps": (edit(PREPROCESSOR, lambda value: value.update(more=1)), "more: .* permitted"),
    "float8": (weights(lambda held: held.update({BIAS: held[BIAS].to(FLOAT8)})), f"{BIAS} in .*{FLOAT8},"),
    "float8 in a state": (
        lambda folder: [
            save_file({"a": torch.full((1,), torch.nan).to(FLOAT8)}, folder / "a.safetensors"),
            step(state_file="a.safetensors")(folder),
        ],
        "a in .*a.safetensors holds numbers that are not finite",
    ),
    "a state of an absurd shape": (
        lambda folder: [
            (folder / "a.safetensors").write_bytes(len(ABSURD).to_bytes(8, "little") + ABSURD),
            step(state_file="a.safetensors")(folder),
        ],
        "a.safetensors is not a valid safetensors file",
    ),
}


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES)
def test_what_is_wrong_with_a_checkpoint_is_named_in_one_line(checkpoint, damage, message, capsys):
    damage(checkpoint)
    with pytest.raises(BimanualError, match=message):
        load_policy(checkpoint)
    code = cli.main(["policy", "check", f"--checkpoint={checkpoint}"])
    output = capsys.readouterr()
    assert code == (3 if "cannot tell whether loading is safe" in output.err else 1)
    assert len(output.err.splitlines()) == 1
    assert len(output.err) < 1000
    assert not output.out


@given(data=st.data())
def test_a_checkpoint_with_changed_bytes_is_read_or_refused(data, sound, tmp_path_factory):
    folder = Path(shutil.copytree(sound, tmp_path_factory.mktemp("changed"), dirs_exist_ok=True))
    file = folder / data.draw(st.sampled_from([CONFIG, PREPROCESSOR, POSTPROCESSOR, WEIGHTS]))
    content = file.read_bytes()
    start = data.draw(st.integers(0, len(content)))
    end = data.draw(st.sampled_from([start, start + 1, start + 8, len(content)]))
    file.write_bytes(content[:start] + data.draw(st.binary(max_size=8)) + content[end:])
    with contextlib.suppress(CheckpointError):  # nothing else
        check_checkpoint(folder)


def test_a_program_in_a_checkpoint_does_not_run(checkpoint, tmp_path):
    marker = tmp_path / "it_ran"
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text('{"total_frames": 1}')
    for name in (PREPROCESSOR, POSTPROCESSOR):
        stranger = {"class": "subprocess.Popen", "config": {"args": ["touch", str(marker)]}}
        edit(name, lambda value, stranger=stranger: value["steps"].insert(0, stranger))(checkpoint)
        for command in ("check", "accuracy", "inspect"):
            data = [] if command == "check" else [f"--root={tmp_path}"]
            assert cli.main(["policy", command, f"--checkpoint={checkpoint}", *data]) == 1
        with pytest.raises(CheckpointError, match=r"subprocess\.Popen.*Do not load"):
            load_policy(checkpoint)
    assert not marker.exists()


def test_a_sound_checkpoint_is_described_and_loaded_strictly(
    save_policy, policy_type, specimens, make_batch, tmp_path, capsys
):
    for variant, options in specimens[policy_type].tiny.items():
        checkpoint = save_policy(policy_type, options, tmp_path / variant)
        assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 0
        said = capsys.readouterr().out
        loaded, _ = load_policy(checkpoint)
        parameters = sum(value.numel() for value in loaded.parameters())
        for part in (policy_type, f"{parameters:,} numbers", "normalizer_processor"):
            assert part in said
        stock = type(loaded).from_pretrained(checkpoint)
        batch = make_batch()
        assert torch.equal(loaded.select_action(batch), stock.select_action(batch))
        weights(lambda held: held.update({name: value.half() for name, value in held.items()}))(checkpoint)
        assert {value.dtype for value in load_policy(checkpoint)[0].parameters()} == {torch.float32}
        weights(lambda tensors: tensors.pop(min(tensors)))(checkpoint)
        with pytest.raises(CheckpointError, match="Missing key"):
            type(loaded).from_pretrained(checkpoint)


def test_what_may_look_something_up_is_not_called_safe(checkpoint, specimens):
    for name in PreTrainedConfig.get_known_choices().keys() - SAFE_POLICIES - specimens.keys():
        config(type=name, vlm_model_name="evil/repo")(checkpoint)
        with pytest.raises(
            UnverifiableCheckpoint, match=f"policy '{name}' .*vlm_model_name='evil/repo' by name"
        ):
            check_checkpoint(checkpoint)


def test_no_step_that_lerobot_registers_is_safe_but_those_on_the_list(tmp_path):
    for name in set(ProcessorStepRegistry.list()) - SAFE_STEPS.keys():
        options = {"action_tokenizer_name": "evil/repo"}
        processor = {"name": "x", "steps": [{"registry_name": name, "config": options}]}
        with pytest.raises(
            UnverifiableCheckpoint, match=f"the step '{name}' loads action_tokenizer_name='evil/repo'"
        ):
            step_names(tmp_path, processor)


def test_a_policy_that_is_compiled_is_checked_without_compiling(checkpoint, monkeypatch):
    monkeypatch.setattr(torch, "compile", lambda *_, **__: pytest.fail("compiled"))
    config(compile=True)(checkpoint)
    check_checkpoint(checkpoint)


def test_a_policy_of_lerobot_is_checked_without_being_built(checkpoint, capsys):
    act = ACTConfig(device="cpu")
    act.input_features = {FRONT: PolicyFeature(FeatureType.VISUAL, (3, 32, 32))}
    act.output_features = {"action": PolicyFeature(FeatureType.ACTION, (16,))}
    for each in (act, *make_pre_post_processors(act)):  # beside weights that do not fit
        each.save_pretrained(checkpoint)
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 0
    assert capsys.readouterr().out.startswith("act with")
    with pytest.raises(CheckpointError, match="not built on `KeyposePolicy`"):
        load_policy(checkpoint)
    weights(lambda tensors: tensors[min(tensors)].fill_(torch.nan))(checkpoint)
    with pytest.raises(CheckpointError, match="not finite"):
        check_checkpoint(checkpoint)
