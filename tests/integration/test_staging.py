"""Nothing finished is lost, nothing foreign is touched, and a dataset is complete only if all of it is as published."""

import errno
import os
import shutil
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest
from corruptions import rewrite

from lerobot_bimanual.dataset.checksums import write_checksums
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, Provenance
from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate, make_dataset, settings_of
from lerobot_env_bimanual.generation.staging import new_folder, place_shard, plain_write_errors, staged


@pytest.fixture(scope="module")
def options(small_generation):
    """Options of a dataset of two shards with one episode each."""
    return partial(small_generation, view="keyframes", episodes=2, episodes_per_shard=1)


@pytest.fixture(scope="module")
def half_done(options, records_here, tmp_path_factory) -> Path:
    """Staging folder of a run that was interrupted with both shards recorded, before merging."""
    config = options(tmp_path_factory.mktemp("half") / "small")
    with pytest.raises(KeyboardInterrupt, match="2 shards are finished"):
        make_dataset(settings_of(config), config.root, records_here(limit=2))
    return config.root.with_name("small.partial")


@pytest.fixture
def begun(options, half_done, tmp_path):
    """Options and staging folder of such a run, to be changed."""
    return options(tmp_path / "small"), Path(shutil.copytree(half_done, tmp_path / "small.partial"))


def test_finished_shards_are_taken_over_and_the_rest_recorded(begun, records_here) -> None:
    config, folder = begun
    shutil.rmtree(folder / "shards/000001")
    (folder / "tmp-1" / "frames").mkdir(parents=True)  # as a killed run leaves it
    (folder / "tmp-1" / "link").symlink_to("/etc")
    executor = records_here()
    make_dataset(settings_of(config), config.root, executor)
    assert executor.recorded == ["000001"]
    made = Provenance.read(config.root / PROVENANCE_FILE)
    assert [episode.seed for episode in made.episodes] == [0, 1]
    assert not folder.exists()
    assert Path("/etc").is_dir()


def test_shards_of_another_origin_are_refused_and_kept(begun) -> None:
    config, folder = begun
    rewrite(folder / "origin.json", lambda origin: origin["settings"].update(episodes=5))
    rewrite(folder / "origin.json", lambda origin: origin["versions"].update(mujoco="1.2.3"))
    rewrite(folder / "origin.json", lambda origin: origin["worlds"].update(lift_ball="0123456789ab"))
    differences = r"episodes is 5, not 2; mujoco is '1\.2\.3', not .*; lift_ball is '0123456789ab'"
    with pytest.raises(BimanualError, match=differences), staged(config.root, settings_of(config)):
        pass
    assert len([*(folder / "shards").iterdir()]) == 2


def test_two_runs_at_one_root_are_refused(options, tmp_path) -> None:
    settings = settings_of(options(tmp_path / "shared"))
    with (
        staged(tmp_path / "shared", settings),
        pytest.raises(BimanualError, match=r"shared\.partial is being written by another process"),
        staged(tmp_path / "shared", settings),
    ):
        pass


def test_foreign_files_and_shards_of_other_candidates_are_refused_and_left_alone(begun) -> None:
    config, folder = begun
    mine = folder / "notes.txt"
    mine.write_text("mine")
    with pytest.raises(DatasetError, match=f"{mine} was not made by this command: move it away"):
        dataset_generate(config)
    assert mine.read_text() == "mine"
    mine.unlink()
    rewrite(folder / "shards/000001/report.json", lambda report: report["episodes"][0].update(seed=7))
    with pytest.raises(DatasetError, match="does not list the planned candidates"):
        dataset_generate(config)


def test_a_full_disk_is_one_clear_error_and_keeps_what_is_finished(begun, records_here, monkeypatch) -> None:
    config, folder = begun
    shutil.rmtree(folder / "shards/000001")
    full = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr(ViewWriter, "end_episode", Mock(side_effect=full))
    with pytest.raises(DatasetError, match=r"no space left on the disk of .*000001; free some and repeat"):
        make_dataset(settings_of(config), config.root, records_here())
    assert [path.name for path in (folder / "shards").iterdir()] == ["000000"]
    assert not list(folder.glob("tmp-*"))


def test_others_may_use_a_finished_shard_as_the_umask_says(tmp_path) -> None:
    before = os.umask(0o007)
    try:
        with new_folder(tmp_path) as folder:
            (folder / "video.mp4").touch(0o600)
            place_shard(folder, shard := tmp_path / "000000")
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o777 for path in (shard, shard / "video.mp4")] == [0o770, 0o660]


def test_only_a_full_disk_is_reported_as_a_full_disk(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("lerobot_env_bimanual.generation.staging.ALMOST_FULL_BYTES", 2**60)
    with pytest.raises(DatasetError, match="Permission denied"), plain_write_errors(tmp_path):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(DatasetError, match="no space left"), plain_write_errors(tmp_path):
        raise RuntimeError("an image writer that does not mention the disk")


def test_a_root_that_is_a_link_is_the_folder_that_it_leads_to(options, tmp_path) -> None:
    place = tmp_path / "disk" / "real"
    place.mkdir(parents=True)
    (tmp_path / "link").symlink_to(place)
    settings = settings_of(options(tmp_path / "link"))
    with staged(tmp_path / "link", settings) as staging, new_folder(staging.folder) as folder:
        assert not staging.is_published()
        (folder / "card").write_text("content")
        staging.publish(folder)
    assert (tmp_path / "link").is_symlink()
    assert (place / "card").read_text() == "content"
    assert [path.name for path in place.parent.iterdir()] == ["real"]


VIDEO = "videos/observation.images.front/chunk-000/file-001.mp4"


def of_other_settings(root: Path) -> None:
    rewrite(root / "keyframes" / PROVENANCE_FILE, lambda origin: origin["settings"].update(first_seed=9))
    write_checksums(root / "keyframes")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda root: shutil.rmtree(root / "frames"), "frames is no longer .*: the view is missing"),
        (lambda root: (root / "frames" / VIDEO).write_bytes(b"0"), f"{VIDEO} has changed"),
        (lambda root: (root / "frames" / PROVENANCE_FILE).write_text(""), r"frames/meta/bimanual\.json: "),
        (of_other_settings, "first_seed is 9, not 0"),
    ],
)
def test_a_dataset_that_is_not_as_published_is_named_and_left_as_it_is(
    generated, small_generation, tree_hashes, tmp_path, damage, message
) -> None:
    published = Path(shutil.copytree(generated, tmp_path / "small"))
    damage(published)
    before = tree_hashes(published)
    with pytest.raises(BimanualError, match=message):
        dataset_generate(small_generation(published))
    assert tree_hashes(published) == before
    assert [path.name for path in published.parent.iterdir()] == [published.name]
