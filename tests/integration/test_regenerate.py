"""A dataset is made again from its provenance, and from nothing else that the file says."""

import json
import shutil
from pathlib import Path

import pytest
from corruptions import rewrite

from lerobot_bimanual.cli.command_line import main
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.results.record import BadRecord
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate
from lerobot_env_bimanual.commands.dataset_regenerate import DatasetRegenerateConfig, dataset_regenerate

pytestmark = pytest.mark.sim


@pytest.fixture
def provenance(generated, tmp_path) -> Path:
    """The file that says where the small dataset comes from, alone."""
    return Path(shutil.copyfile(generated / "frames" / PROVENANCE_FILE, tmp_path / "small.json"))


@pytest.fixture
def never(provenance, tmp_path) -> DatasetRegenerateConfig:
    """Options of a command that is refused before it makes the root folder."""
    return DatasetRegenerateConfig(provenance=provenance, root=tmp_path / "never")


@pytest.mark.slow
def test_a_dataset_of_a_perturbed_world_is_complete_sound_and_made_again(
    small_generation, tmp_path, tree_hashes, capsys
) -> None:
    config = small_generation(
        tmp_path / "made", episodes=1, view="keyframes", perturb="camera_moved:2,light:1"
    )
    dataset_generate(config)
    dataset = RecordedDataset(config.root)
    assert dataset.calibration is None  # cameras stand elsewhere in every episode, so every row says where
    assert dataset.episode(0).columns[schema.CAMERA_EXTRINSICS].shape[1:] == (80,)
    dataset_generate(config)
    assert "is already complete" in capsys.readouterr().out
    assert main(["dataset", "verify", f"--root={config.root}", "--workers=1"]) == 0
    assert "warning" not in capsys.readouterr().out
    provenance, again = config.root / PROVENANCE_FILE, tmp_path / "again" / "made"
    dataset_regenerate(DatasetRegenerateConfig(provenance=provenance, root=again, workers=1))
    assert tree_hashes(again) == tree_hashes(config.root)


@pytest.mark.parametrize(
    ("field", "other", "message"),
    [
        (
            "versions",
            {"mujoco": "1.2.3", "lerobot": "0.0.1"},
            r"generated with mujoco 1\.2\.3 \(installed: ",
        ),
        ("versions", {"libc": "glibc-1.0"}, r"made with the C library glibc-1\.0 \(here: "),
        ("worlds", {"lift_ball": "0123456789ab"}, "lift_ball in world 0123456789ab"),
    ],
)
def test_the_provenance_of_another_simulation_is_refused(provenance, never, field, other, message) -> None:
    rewrite(provenance, lambda origin: origin[field].update(other))
    with pytest.raises(DatasetError, match=message):
        dataset_regenerate(never)
    assert not never.root.exists()


def test_the_command_of_a_provenance_is_never_obeyed(provenance, tmp_path, records_here, monkeypatch) -> None:
    """The settings ask for the small dataset; who records it is up to the user."""
    workers = []
    monkeypatch.setattr(
        "lerobot_env_bimanual.generation.build.process_executor",
        lambda count: workers.append(count) or records_here(),
    )
    strangers = (
        "lerobot-bimanual dataset generate --task=push_box --episodes=99 --repo_id=some/body --workers=99 "
        "--config_path=/etc/x.yaml --root=/"
    )
    rewrite(provenance, lambda origin: origin.update(command=strangers))
    rewrite(provenance, lambda origin: origin["settings"].update(views=["keyframes"], episodes=1))
    rewrite(provenance, lambda origin: origin.update(episodes=origin["episodes"][:1]))
    dataset_regenerate(DatasetRegenerateConfig(provenance=provenance, root=tmp_path / "again", workers=3))
    assert workers == [3]
    made = json.loads((tmp_path / "again" / PROVENANCE_FILE).read_text())
    assert made["settings"] == json.loads(provenance.read_text())["settings"]
    assert not any(word in made["command"] for word in ("push_box", "99", "config_path"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": ["no_such_task"]}, "task is 'no_such_task'"),
        ({"episodes": -1}, "episodes: .* but is -1"),
        ({"command": "ls"}, "command: Extra inputs"),
        ({"intermediate": ["half"]}, "intermediate.0: "),
        ({"repo_id": "../../elsewhere"}, "repo_id: "),
    ],
)
def test_settings_of_no_dataset_are_refused(provenance, never, changes, message) -> None:
    rewrite(provenance, lambda origin: origin["settings"].update(changes))
    with pytest.raises(DatasetError, match=f"small.json: no dataset has these settings: .*{message}"):
        dataset_regenerate(never)
    assert not never.root.exists()


@pytest.mark.parametrize("content", [b"{}", b"", b"\xff\xfe{}", b"[" * 100_000, "3.3; rm -rf ~", "3.3`id`"])
def test_a_file_that_is_no_provenance_or_names_no_version_is_refused(provenance, never, content) -> None:
    if isinstance(content, bytes):
        provenance.write_bytes(content)
    else:
        rewrite(provenance, lambda origin: origin["versions"].update(mujoco=content))
    with pytest.raises(
        BadRecord, match=r"small\.json: (.*is missing|.*JSON|versions\.mujoco: String should)"
    ):
        dataset_regenerate(never)
