"""A checkpoint is data: nothing that it names runs, and what is missing, damaged or unknown is named in one line."""

import contextlib
import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import get_policy_class
from safetensors.torch import load_file, save_file

from lerobot_bimanual import cli
from lerobot_policy_bimanual.checkpoint.check import check_checkpoint
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.inspection.loading import load_policy

CONFIG, WEIGHTS = "config.json", "model.safetensors"
PREPROCESSOR, POSTPROCESSOR = "policy_preprocessor.json", "policy_postprocessor.json"
BIAS = "network.stem.conv.bias"

Damage = Callable[[Path], Any]


@pytest.fixture(scope="module")
def sound(save_policy, tmp_path_factory: pytest.TempPathFactory, tiny: dict[str, Any]) -> Path:
    return save_policy("peract2", tiny, tmp_path_factory.mktemp("sound"))


@pytest.fixture
def checkpoint(sound: Path, tmp_path: Path) -> Path:
    """A sound checkpoint to damage."""
    return Path(shutil.copytree(sound, tmp_path / "pretrained_model"))


def edit(name: str, change: Callable[[dict], Any]) -> Damage:
    def damage(folder: Path) -> None:
        value = json.loads((folder / name).read_text())
        change(value)
        (folder / name).write_text(json.dumps(value))

    return damage


def config(**changes: Any) -> Damage:
    return edit(CONFIG, lambda value: value.update(changes))


def step(**changes: Any) -> Damage:
    """Change the first step of the preprocessor."""
    return edit(PREPROCESSOR, lambda value: value["steps"][0].update(changes))


def weights(change: Callable[[dict[str, torch.Tensor]], Any]) -> Damage:
    def damage(folder: Path) -> None:
        tensors = load_file(folder / WEIGHTS)
        change(tensors)
        save_file(tensors, folder / WEIGHTS)

    return damage


def write(name: str, content: bytes) -> Damage:
    return lambda folder: (folder / name).write_bytes(content)


def remove(name: str) -> Damage:
    return lambda folder: (folder / name).unlink()


DAMAGES: dict[str, tuple[Damage, str]] = {
    "unknown policy": (config(type="stranger"), "no known policy type; known are act"),
    "language too wide for any memory": (config(language_dim=10**9), "language_dim is 1000000000"),
    "normalisation from outside": (config(normalization_mapping={"VISUAL": "MEAN_STD"}), "must be IDENTITY"),
    "an adapter": (config(use_peft=True), "use_peft"),
    "too deep": (write(CONFIG, b"[" * 10**6), "must be JSON"),
    "a config without end": (write(CONFIG, b" " * (2**24 + 1)), "larger than 16 MB"),
    "no config": (remove(CONFIG), "no checkpoint at"),
    "no weights": (remove(WEIGHTS), "model.safetensors is not a valid safetensors file .missing"),
    "pickled weights": (write(WEIGHTS, pickle.dumps({"network": [1, 2]})), "not a valid safetensors file"),
    "a tensor missing": (weights(lambda tensors: tensors.pop(BIAS)), f"lacks tensors.*{BIAS}"),
    "a tensor too many": (weights(lambda tensors: tensors.update(more=torch.ones(1))), "unknown.* more"),
    "a tensor of another shape": (
        weights(lambda tensors: tensors.update({BIAS: torch.ones(9)})),
        r"is \(9,\)",
    ),
    "one infinite weight": (
        weights(lambda tensors: tensors[BIAS].view(-1)[:1].fill_(torch.inf)),
        f"{BIAS} in .* not finite",
    ),
    "no preprocessor": (remove(PREPROCESSOR), "policy_preprocessor.json does not exist"),
    "a step by class": (
        edit(PREPROCESSOR, lambda value: value["steps"].append({"class": "subprocess.Popen"})),
        "names the class 'subprocess.Popen'",
    ),
    "an unknown step": (step(registry_name="stranger"), "which LeRobot does not have"),
    "another step of LeRobot": (step(registry_name="tokenizer_processor"), "but must list"),
    "a state file outside": (step(state_file="../secret.safetensors"), "not in the same folder"),
}


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES)
def test_what_is_wrong_with_a_checkpoint_is_named_in_one_line(checkpoint, damage, message, capsys):
    damage(checkpoint)
    with pytest.raises(CheckpointError, match=message):
        load_policy(checkpoint)
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 1
    output = capsys.readouterr()
    assert len(output.err.splitlines()) == 1
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


def test_a_program_in_a_checkpoint_of_any_policy_does_not_run(save_policy, policy_type, specimens, tmp_path):
    checkpoint = save_policy(
        policy_type, next(iter(specimens[policy_type].tiny.values())), tmp_path / "model"
    )
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


def test_a_sound_checkpoint_of_any_policy_is_loaded_and_described(
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


def test_lerobot_loads_the_weights_of_a_policy_strictly(save_policy, policy_type, specimens, tmp_path):
    checkpoint = save_policy(policy_type, next(iter(specimens[policy_type].tiny.values())), tmp_path)
    stock = get_policy_class(policy_type)
    stock.from_pretrained(checkpoint)
    weights(lambda tensors: tensors.pop(min(tensors)))(checkpoint)
    with pytest.raises(CheckpointError, match="lacks tensors"):
        stock.from_pretrained(checkpoint)


def test_the_file_of_a_clip_tower_is_not_opened_to_check_a_policy_that_uses_it(checkpoint):
    weights(lambda tensors: [tensors.pop(name) for name in list(tensors) if name.startswith("language.")])(
        checkpoint
    )
    config(language_encoder="clip:/no/such/folder")(checkpoint)
    assert check_checkpoint(checkpoint).config.language_encoder == "clip:/no/such/folder"


def test_a_policy_of_lerobot_is_checked_without_being_built(save_policy, tmp_path, capsys):
    options = {
        "device": "cpu",
        "pretrained_backbone_weights": None,
        "dim_model": 32,
        "n_heads": 2,
        "dim_feedforward": 64,
        "n_encoder_layers": 1,
        "n_vae_encoder_layers": 1,
        "input_features": {
            "observation.images.front": PolicyFeature(FeatureType.VISUAL, (3, 32, 32)),
            "observation.state": PolicyFeature(FeatureType.STATE, (16,)),
        },
        "output_features": {"action": PolicyFeature(FeatureType.ACTION, (16,))},
    }
    act = save_policy("act", options, tmp_path / "act")
    assert cli.main(["policy", "check", f"--checkpoint={act}"]) == 0
    assert capsys.readouterr().out.startswith("act with")
    with pytest.raises(CheckpointError, match="predicts no keyposes"):
        load_policy(act)
    weights(lambda tensors: tensors[min(tensors)].fill_(torch.nan))(act)
    with pytest.raises(CheckpointError, match="not finite"):
        check_checkpoint(act)
    step(**{"class": "subprocess.Popen"})(act)
    with pytest.raises(CheckpointError, match="names the class"):
        check_checkpoint(act)
