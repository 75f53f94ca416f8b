"""The verb `verify`: what it prints, with which code it ends, and which views it looks at."""

import shutil
from pathlib import Path

import damages
import pytest

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.content_hash import content_hash
from lerobot_bimanual.dataset.reader import read_info
from lerobot_bimanual.dataset.seal import write_seal
from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate
from lerobot_env_bimanual.commands.dataset_verify import DatasetVerifyConfig, dataset_verify

pytestmark = pytest.mark.sim


def test_a_generated_dataset_passes_and_its_hashes_are_printed(generated, capsys) -> None:
    assert dataset_verify(DatasetVerifyConfig(root=generated, render="2", workers=1)) == 0
    printed = capsys.readouterr().out
    assert "not replayed" not in printed
    for view in schema.VIEWS:
        assert f"content hash: {content_hash(generated / view)}" in printed
    for check in ("replay", "replayed actions", "rendered RGB", "rendered depth", "LeRobot's loader"):
        assert check in printed


def test_the_verb_fails_and_says_where(copy, capsys) -> None:
    root = copy("keyframes")
    damages.edit(root, damages.FIRST, schema.KEYFRAME, lambda flags, rows: flags.__setitem__(rows[0], True))
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1, render="0")) == 1
    printed = capsys.readouterr().out
    assert "keyframes: episode 1, row 0: keyframe is set, but no keypose was completed" in printed
    assert "seal: " in printed


@pytest.mark.parametrize(
    ("field", "other", "remark"),
    [
        ("versions", {"mujoco": "1.2.3"}, "generated with mujoco 1.2.3 (installed: 3."),
        ("worlds", {"lift_ball": "0123456789ab"}, "it holds lift_ball in world 0123456789ab (here: "),
    ],
    ids=["another version", "another world"],
)
def test_not_replayed_is_not_passed(copy, capsys, field, other, remark) -> None:
    root = copy("keyframes")
    damages.provenance(lambda origin: origin[field].update(other))(root)
    write_card(root, "local/small")
    write_seal(root)
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1)) == 3
    printed = capsys.readouterr().out
    assert f"not replayed, so not passed: {remark}" in printed
    assert "replayed actions" not in printed


def test_a_dataset_without_depth_holds_colours_alone_and_passes(small_generation, tmp_path, capsys) -> None:
    root = tmp_path / "colours"
    dataset_generate(small_generation(root, episodes=1, depth=False))
    for view in schema.VIEWS:
        stored = read_info(root / view)["features"].keys()
        assert schema.image_key("front") in stored
        assert schema.depth_key("front") not in stored
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1)) == 0
    assert "not replayed" not in capsys.readouterr().out


@pytest.mark.parametrize("lost", ["", "meta/info.json"])
def test_a_view_that_is_missing_is_a_finding(generated, tmp_path, capsys, lost) -> None:
    root = Path(shutil.copytree(generated, tmp_path / "data"))
    if lost:
        (root / "frames" / lost).unlink()
    else:
        shutil.rmtree(root / "frames")
    assert dataset_verify(DatasetVerifyConfig(root=root, render="0", episodes="0", workers=1)) == 1
    assert "frames" in capsys.readouterr().out


def test_what_a_terminal_would_obey_is_printed_as_text(generated, tmp_path, capsys) -> None:
    root = Path(shutil.copytree(generated / "keyframes", tmp_path / "data"))
    (root / "\x1b[2Jgone").touch()
    assert dataset_verify(DatasetVerifyConfig(root=root, render="0", episodes="0", workers=1)) == 1
    assert "\x1b[2J" not in capsys.readouterr().out


def test_a_dataset_that_cannot_be_opened_is_a_finding_and_the_other_view_is_still_checked(
    generated, tmp_path, capsys
) -> None:
    root = Path(shutil.copytree(generated, tmp_path / "copy"))
    (root / "frames/meta/info.json").write_text("[]")
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1, render="0")) == 1
    printed = capsys.readouterr().out
    assert "readable: " in printed
    assert printed.count("content hash: ") == 1


@pytest.mark.parametrize("rows", ["-1", "some", "1.5", ""])
def test_rows_that_are_no_number_are_refused(generated, rows: str) -> None:
    with pytest.raises(BimanualError, match="number of rows per episode, such as 3, or 'all'"):
        dataset_verify(DatasetVerifyConfig(root=generated, render=rows))
