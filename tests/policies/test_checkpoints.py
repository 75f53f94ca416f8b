"""A checkpoint is data: whatever stands in it, nothing of it runs, and what is damaged is named."""

import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from safetensors.torch import load_file, save_file

from lerobot_bimanual import cli
from lerobot_policy_bimanual.checkpoint.check import check_checkpoint
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.inspection.loading import load_policy

CONFIG, WEIGHTS = "config.json", "model.safetensors"
PREPROCESSOR, POSTPROCESSOR = "policy_preprocessor.json", "policy_postprocessor.json"

Damage = Callable[[Path], Any]


def save(name: str, options: dict[str, Any], folder: Path) -> Path:
    """A new policy with its processors, written as LeRobot writes them."""
    config = PreTrainedConfig.get_choice_class(name)(**options)
    get_policy_class(name)(config).save_pretrained(folder)
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, tiny_peract: dict[str, Any]) -> Path:
    return save("peract2", tiny_peract, tmp_path_factory.mktemp("sound"))


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


def cut(name: str) -> Damage:
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:-100])


def remove(name: str) -> Damage:
    return lambda folder: (folder / name).unlink()


def folder_instead_of(name: str) -> Damage:
    return lambda folder: ((folder / name).unlink(), (folder / name).mkdir())


def link(name: str, target: str) -> Damage:
    return lambda folder: ((folder / name).unlink(), (folder / name).symlink_to(target))


BIAS = "network.stem.conv.bias"
BEYOND = b'{"x": {"dtype": "F32", "shape": [1000000000], "data_offsets": [0, 4000000000]}}'
DAMAGES: dict[str, tuple[Damage, str]] = {
    "unknown policy": (config(type="stranger"), "type is 'stranger'"),
    "policy that is no name": (config(type=["peract2"]), "must be one of: act"),
    "no policy": (edit(CONFIG, lambda value: value.pop("type")), "type is None"),
    "unknown field": (config(trust_remote_code=True), "trust_remote_code"),
    "no heads": (config(heads=0), "heads is 0, but must be a whole number from 1"),
    "heads as text": (config(heads="2"), "heads is '2', which would be read as 2"),
    "heads in part": (config(heads=2.5), "heads"),
    "heads as truth": (config(heads=True), "heads is True"),
    "heads as list": (config(heads=[2]), "heads"),
    "no heads at all": (config(heads=None), "heads is None"),
    "rotation bins of no width": (config(rotation_bin_deg=0), "rotation_bin_deg is 0"),
    "rotation bins backwards": (config(rotation_bin_deg=-5), "rotation_bin_deg is -5"),
    "rotation bins that do not close": (config(rotation_bin_deg=7), "must divide 360"),
    "language too wide for any memory": (config(language_dim=10**9), "language_dim is 1000000000"),
    "no language": (config(language_tokens=0), "language_tokens is 0"),
    "voxels beyond any memory": (config(voxel_size=5 * 10**8), "voxel_size is 500000000"),
    "depth beyond any patience": (config(depth=10**12), "depth is 1000000000000"),
    "a camera twice": (config(cameras=["front", "front"]), "none twice"),
    "unknown camera": (config(cameras=["moon"]), "unknown camera 'moon'"),
    "cameras as a number": (config(cameras=3), "cameras"),
    "workspace upside down": (config(workspace_lower=[0, 0, 2]), "must be below"),
    "workspace in a plane": (config(workspace_lower=[0, 0]), "workspace_lower"),
    "another device": (config(device="abacus"), "Unknown device abacus"),
    "normalisation from outside": (
        config(normalization_mapping={"VISUAL": "MEAN_STD"}),
        "normalization_mapping must be IDENTITY",
    ),
    "an adapter": (config(use_peft=True), "use_peft"),
    "inputs without depth": (
        config(input_features={"observation.state": {"type": "STATE", "shape": [16]}}),
        "front_depth",
    ),
    "inputs of no shape": (config(input_features={"observation.state": 5}), "input_features"),
    "not a number": (write(CONFIG, b'{"type": "peract2", "heads": NaN}'), "NaN is no number"),
    "infinite": (
        write(CONFIG, b'{"type": "peract2", "optimizer_lr": 1e999}'),
        "1e999 is larger than any number",
    ),
    "a key twice": (write(CONFIG, b'{"type": "peract2", "type": "act"}'), "stands there twice"),
    "no JSON": (write(CONFIG, b"{"), "must be JSON"),
    "a list": (write(CONFIG, b"[]"), "must hold an object"),
    "no UTF-8": (write(CONFIG, b'{"type": "\xff"}'), "must be JSON"),
    "too deep": (write(CONFIG, b"[" * 10**6), "must be JSON"),
    "a config without end": (write(CONFIG, b" " * (2**24 + 1)), "larger than 16 MB"),
    "an empty config": (write(CONFIG, b""), "must be JSON"),
    "no config": (remove(CONFIG), "no checkpoint at"),
    "no weights": (remove(WEIGHTS), "model.safetensors does not exist"),
    "weights cut off": (cut(WEIGHTS), "no whole file of tensors"),
    "empty weights": (write(WEIGHTS, b""), "no whole file of tensors"),
    "pickled weights": (write(WEIGHTS, pickle.dumps({"network": [1, 2]})), "no whole file of tensors"),
    "a tensor missing": (weights(lambda tensors: tensors.pop(BIAS)), f"lacks tensors.*{BIAS}"),
    "a tensor too many": (weights(lambda tensors: tensors.update(more=torch.ones(1))), "too many.* more"),
    "a tensor of another shape": (
        weights(lambda tensors: tensors.update({BIAS: torch.ones(9)})),
        r"is \(9,\)",
    ),
    "a tensor of another type": (
        weights(lambda tensors: tensors.update({BIAS: tensors[BIAS].double()})),
        "torch.float64, but",
    ),
    "weights that are no numbers": (weights(lambda tensors: tensors[BIAS].fill_(torch.nan)), "not finite"),
    "one infinite weight": (
        weights(lambda tensors: tensors[BIAS].view(-1)[:1].fill_(torch.inf)),
        f"{BIAS} in .* not finite",
    ),
    "no preprocessor": (remove(PREPROCESSOR), "policy_preprocessor.json does not exist"),
    "no postprocessor": (remove(POSTPROCESSOR), "policy_postprocessor.json does not exist"),
    "half a preprocessor": (cut(PREPROCESSOR), "policy_preprocessor.json: must be JSON"),
    "no steps": (edit(PREPROCESSOR, lambda value: value.pop("steps")), "no list of steps"),
    "a step that is no object": (
        edit(PREPROCESSOR, lambda value: value["steps"].append("x")),
        "no list of steps",
    ),
    "a step by class": (
        edit(PREPROCESSOR, lambda value: value["steps"].append({"class": "subprocess.Popen"})),
        "names a step by class",
    ),
    "a step by name and class": (step(**{"class": "subprocess.Popen"}), "names a step by class"),
    "an unknown step": (step(registry_name="stranger"), "which LeRobot does not have"),
    "another step of LeRobot": (step(registry_name="tokenizer_processor"), "but must list"),
    "a step too many": (
        edit(PREPROCESSOR, lambda value: value["steps"].append(value["steps"][0])),
        "but must list",
    ),
    "an option that the step lacks": (step(config={"rename_map": {}, "shell": True}), "no option 'shell'"),
    "an option of another type": (step(config={"rename_map": {"a": 1}}), "rename_map"),
    "another normalisation": (
        edit(PREPROCESSOR, lambda value: value["steps"][3]["config"]["norm_map"].update(VISUAL="MEAN_STD")),
        "norm_map",
    ),
    "a number beyond all": (config(optimizer_lr=10**400), "too large|optimizer_lr"),
    "heads beyond all": (config(heads=10**400), "heads"),
    "options that are no object": (step(config=[]), "are no object"),
    "a key that no step has": (step(args=["sh"]), "unknown key 'args'"),
    "a state file outside": (step(state_file="../secret.safetensors"), "not a file of the same folder"),
    "a state file at the root": (step(state_file="/etc/passwd"), "not a file of the same folder"),
    "a state file elsewhere on Windows": (step(state_file="..\\x"), "not a file of the same folder"),
    "a state file that is no name": (step(state_file=5), "not a file of the same folder"),
    "a state file that is not there": (step(state_file="x.safetensors"), "x.safetensors does not exist"),
    "a state file that is none": (step(state_file=CONFIG), "no whole file of tensors"),
    "a step without a name": (edit(PREPROCESSOR, lambda value: value["steps"][0].clear()), "by class, None"),
    "a step named by a number": (step(registry_name=5), "names a step by class"),
    "a step named like a path": (step(registry_name="os:system"), "which LeRobot does not have"),
    "the other file's steps": (
        lambda folder: (folder / PREPROCESSOR).write_bytes((folder / POSTPROCESSOR).read_bytes()),
        "but must list",
    ),
    "steps by number": (edit(POSTPROCESSOR, lambda value: value.update(steps={"0": {}})), "no list of steps"),
    "a folder for weights": (folder_instead_of(WEIGHTS), "model.safetensors does not exist"),
    "a folder for a config": (folder_instead_of(CONFIG), "no checkpoint at"),
    "a link to nothing": (link(WEIGHTS, "/no/such/file"), "model.safetensors does not exist"),
    "a link to a text": (link(WEIGHTS, __file__), "no whole file of tensors"),
    "weights with an endless header": (write(WEIGHTS, b"\xff" * 7 + b"\x7f{}"), "no whole file of tensors"),
    "weights behind their file's end": (
        write(WEIGHTS, len(BEYOND).to_bytes(8, "little") + BEYOND),
        "no whole file of tensors",
    ),
    "weights in half precision": (
        weights(lambda tensors: tensors.update({name: t.half() for name, t in tensors.items()})),
        "torch.float16, but",
    ),
    "a tensor of another name": (
        weights(lambda tensors: tensors.update(x=tensors.pop(BIAS))),
        f"lacks .*{BIAS}",
    ),
    "an empty tensor": (weights(lambda tensors: tensors.update({BIAS: torch.ones(0)})), r"is \(0,\)"),
    "a weight minus infinity": (weights(lambda tensors: tensors[BIAS].fill_(-torch.inf)), "not finite"),
    "heads in hexadecimal": (config(heads="0x2"), "heads"),
    "a camera in a list": (config(cameras=[["front"]]), "unknown camera"),
    "cameras by name": (config(cameras={"front": True}), "cameras"),
    "a time that stands still": (config(keypose_horizon=1), "keypose_horizon is 1"),
    "an endless workspace": (config(workspace_upper=[1e308, 1, 1]), "workspace_upper is"),
    "warm-up after the end": (config(warmup_fraction=2), "warmup_fraction is 2"),
    "learning backwards": (config(optimizer_lr=-1), "optimizer_lr is -1"),
    "instructions as one text": (config(trained_instructions="lift"), "trained_instructions"),
    "endless instructions": (config(trained_instructions=["lift"] * 1001), "up to 1000 texts"),
    "normalisation in a list": (config(normalization_mapping=["IDENTITY"]), "normalization_mapping"),
    "half a language": (config(language_encoder="clip"), "language_encoder is 'clip'"),
}


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES)
def test_whatever_is_wrong_with_a_checkpoint_is_named_in_one_line(checkpoint, damage, message, capsys):
    damage(checkpoint)
    for load in (check_checkpoint, load_policy):
        with pytest.raises(CheckpointError, match=message):
            load(checkpoint)
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 1
    output = capsys.readouterr()
    assert output.err.startswith("lerobot-bimanual: ")
    assert len(output.err.splitlines()) == 1
    assert not output.out


def test_a_program_in_a_checkpoint_of_any_policy_does_not_run(policy_type, specimens, tmp_path):
    checkpoint = save(policy_type, next(iter(specimens[policy_type].tiny.values())), tmp_path / "model")
    marker = tmp_path / "it_ran"
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text("{}")
    for name in (PREPROCESSOR, POSTPROCESSOR):
        stranger = {"class": "subprocess.Popen", "config": {"args": ["touch", str(marker)]}}
        edit(name, lambda value, stranger=stranger: value["steps"].insert(0, stranger))(checkpoint)
        for leaf in ("check", "accuracy", "inspect"):
            data = [] if leaf == "check" else [f"--dataset={tmp_path}"]
            assert cli.main(["policy", leaf, f"--checkpoint={checkpoint}", *data]) == 1
        with pytest.raises(CheckpointError, match=r"subprocess\.Popen.*Do not load"):
            load_policy(checkpoint)
    assert not marker.exists()


def test_a_sound_checkpoint_of_any_policy_is_loaded_and_described(
    policy_type, specimens, make_batch, tmp_path, capsys
):
    for variant, options in specimens[policy_type].tiny.items():
        checkpoint = save(policy_type, options, tmp_path / variant)
        assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 0
        said = capsys.readouterr().out
        loaded, _ = load_policy(checkpoint)
        parameters = sum(value.numel() for value in loaded.parameters())
        for part in (policy_type, "left_wrist", f"{parameters:,} numbers", "normalizer_processor"):
            assert part in said
        stock = type(loaded).from_pretrained(checkpoint)
        batch = make_batch()
        assert torch.equal(loaded.select_action(batch), stock.select_action(batch))


def test_weights_are_strict_on_every_way_that_lerobot_loads_a_policy(policy_type, specimens, tmp_path):
    checkpoint = save(policy_type, next(iter(specimens[policy_type].tiny.values())), tmp_path)
    stock = get_policy_class(policy_type)
    for change, message in (
        (lambda tensors: tensors.pop(min(tensors)), "lacks tensors"),
        (lambda tensors: tensors.update(more=torch.ones(1)), "too many"),
        (lambda tensors: tensors[min(tensors)].fill_(torch.nan), "not finite"),
    ):
        before = (checkpoint / WEIGHTS).read_bytes()
        weights(change)(checkpoint)
        with pytest.raises(CheckpointError, match=message):
            stock.from_pretrained(checkpoint)
        (checkpoint / WEIGHTS).write_bytes(before)
    stock.from_pretrained(checkpoint)


def test_the_file_of_a_clip_tower_is_not_opened_to_check_a_policy_that_uses_it(checkpoint, capsys):
    weights(lambda tensors: [tensors.pop(name) for name in list(tensors) if name.startswith("language.")])(
        checkpoint
    )
    config(language_encoder="clip:/no/such/folder")(checkpoint)
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 0
    assert "not checked clip:/no/such/folder" in " ".join(capsys.readouterr().out.split())


@pytest.fixture
def act(tmp_path: Path) -> Path:
    """A small ACT."""
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
    return save("act", options, tmp_path / "act")


def test_lerobots_own_policies_are_checked_and_it_is_said_how_far(act, capsys):
    assert cli.main(["policy", "check", f"--checkpoint={act}"]) == 0
    said = capsys.readouterr().out
    assert "observation.images.front" in said
    assert "not checked whether the weights fit" in " ".join(said.split())
    with pytest.raises(CheckpointError, match="predicts no keyposes"):
        load_policy(act)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (step(**{"class": "subprocess.Popen"}), "names a step by class"),
        (step(registry_name="stranger"), "which LeRobot does not have"),
        (config(dim_model="32"), "dim_model is '32'"),
        (cut(WEIGHTS), "no whole file of tensors"),
        (weights(lambda tensors: tensors[min(tensors)].fill_(torch.nan)), "not finite"),
    ],
)
def test_damage_to_lerobots_own_policies_is_named(act, damage, message):
    damage(act)
    with pytest.raises(CheckpointError, match=message):
        check_checkpoint(act)
