"""A dataset is called complete when all of it is at its place, as it was published, and otherwise left as it is."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.seal import SEAL_FILE, seal_problems, write_seal
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate

pytestmark = pytest.mark.sim

VIDEO = "videos/observation.images.front/chunk-000/file-001.mp4"


@pytest.fixture
def published(generated, tmp_path) -> Path:
    return Path(shutil.copytree(generated, tmp_path / "small"))


def test_every_view_is_sealed_as_it_was_published(generated) -> None:
    for view in ("frames", "keyframes"):
        assert list(seal_problems(generated / view)) == []


def flip_a_bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def rewrite_provenance(root: Path, view: str, change: Callable[[dict], object]) -> None:
    """As somebody who sealed another dataset would have written it: every hash is right."""
    path = root / view / PROVENANCE_FILE
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    write_seal(root / view)


def exchange_views(root: Path) -> None:
    (root / "frames").rename(root / "aside")
    (root / "keyframes").rename(root / "frames")
    (root / "aside").rename(root / "keyframes")


DAMAGES = [
    (lambda root: shutil.rmtree(root / "frames"), "the view .*frames is missing"),
    (lambda root: shutil.rmtree(root / "keyframes"), "the view .*keyframes is missing"),
    (lambda root: (root / "frames" / VIDEO).unlink(), f"in .*frames, {VIDEO} is missing"),
    (lambda root: flip_a_bit(root / "frames" / VIDEO), f"{VIDEO} has changed"),
    (lambda root: (root / "frames/meta/info.json").write_text(""), r"meta/info\.json has changed"),
    (lambda root: (root / "keyframes/README.md").unlink(), r"in .*keyframes, README\.md is missing"),
    (lambda root: (root / "keyframes/data/more.parquet").touch(), r"data/more\.parquet does not belong here"),
    (lambda root: (root / "keyframes/data/link").symlink_to("/etc/passwd"), "data/link is a link"),
    (lambda root: (root / "frames" / SEAL_FILE).unlink(), f"{SEAL_FILE} is missing"),
    (lambda root: (root / "frames" / SEAL_FILE).write_bytes(b"\xff"), f"{SEAL_FILE} is damaged"),
    (lambda root: (root / "frames" / PROVENANCE_FILE).unlink(), f"{PROVENANCE_FILE} is missing"),
    (lambda root: (root / "frames" / PROVENANCE_FILE).write_text(""), "does not say any more what it is"),
    (exchange_views, "frames holds the view 'keyframes'"),
    (
        lambda root: rewrite_provenance(
            root, "frames", lambda origin: origin["versions"].update(mujoco="1.2")
        ),
        r"other settings or versions: mujoco is 1\.2, not",
    ),
    (
        lambda root: rewrite_provenance(
            root, "keyframes", lambda origin: origin["settings"].update(first_seed=9)
        ),
        "first_seed is 9, not 0",
    ),
    (
        lambda root: rewrite_provenance(root, "keyframes", lambda origin: origin["settings"].update(views=7)),
        "no dataset|views is 7",
    ),
    (
        lambda root: rewrite_provenance(root, "keyframes", lambda origin: origin["episodes"].pop()),
        "keyframes has 2 episodes, not 3",
    ),
]


@pytest.mark.parametrize(("damage", "message"), DAMAGES)
def test_a_dataset_that_is_not_as_published_is_named_and_left_as_it_is(
    published, small_generation, tree_hashes, damage, message
) -> None:
    damage(published)
    before = tree_hashes(published)
    with pytest.raises(DatasetError, match=message):
        dataset_generate(small_generation(published))
    assert tree_hashes(published) == before
    assert [path.name for path in published.parent.iterdir()] == [published.name]


def test_the_command_line_says_it_in_one_line_and_fails(published, capsys) -> None:
    words = json.loads((published / "frames" / PROVENANCE_FILE).read_text())["command"].split()[1:]
    assert main([*words, f"--root={published}"]) == 0
    assert "is already complete: 3 episodes" in capsys.readouterr().out
    (published / "frames" / VIDEO).unlink()
    assert main([*words, f"--root={published}"]) == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"{VIDEO} is missing" in told


def test_what_git_and_the_hub_add_does_no_harm(published, small_generation, capsys) -> None:
    for view in ("frames", "keyframes"):
        (published / view / ".gitattributes").write_text("*.mp4 filter=lfs")
        (published / view / ".cache/huggingface").mkdir(parents=True)
        (published / view / ".cache/huggingface/info.json").touch()
    dataset_generate(small_generation(published))
    assert "already complete" in capsys.readouterr().out
