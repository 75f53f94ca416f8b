"""The staging folder survives what happens to its files, and a root where no dataset can be is refused at once."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from lerobot_bimanual.checksums import write_sums
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.dataset_generate import settings_of
from lerobot_env_bimanual.generation.plan import ShardReport, next_round
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard_report import DamagedShard, write_report
from lerobot_env_bimanual.generation.staging import Staging, new_folder, plain_write_errors

NO_ORIGIN = {
    "empty": b"",
    "no UTF-8": b"\xff\xfe{}",
    "null": b"null",
    "a list": b"[]",
    "nothing": b"{}",
    "deep": b"[" * 100_000,
    "no settings": b'{"settings": {}, "versions": {}}',
    "cut": b'{"settings": 1',
}


@pytest.fixture
def settings(small_generation, tmp_path) -> GenerationSettings:
    """Of a dataset of two shards."""
    return settings_of(small_generation(tmp_path / "begun", episodes=4))


@pytest.fixture
def begun(settings, tmp_path) -> Path:
    """Staging folder of a run that was killed before it merged; its shards are reports without episodes' files."""
    with Staging(tmp_path / "begun", settings) as staging:
        for shard in next_round(settings, [], 0):
            staging.shard_folder(shard.name).mkdir()
            write_report(staging.shard_folder(shard.name), settings, ShardReport(shard.candidates, ()))
    return staging.folder


def take_over(folder: Path, settings: GenerationSettings) -> int:
    """How many shards a new run would not record again."""
    with Staging(folder.with_suffix(""), settings) as staging:
        reports = [staging.report(shard) for shard in next_round(settings, [], 0)]
    return sum(report is not None for report in reports)


def edited(stamp: bytes, change: Callable[[dict], object]) -> bytes:
    content = json.loads(stamp)
    change(content)
    return json.dumps(content).encode()


# -- settings.json ------------------------------------------------------------------------------------------


def test_a_dataset_that_was_begun_in_another_world_is_not_gone_on_with(begun, settings) -> None:
    stamp = begun / "settings.json"
    there = "0123456789ab"
    stamp.write_bytes(edited(stamp.read_bytes(), lambda content: content["worlds"].update(lift_ball=there)))
    with pytest.raises(
        DatasetError, match=rf"begun with lift_ball in world {there} \(here: [0-9a-f]{{12}}\)"
    ):
        take_over(begun, settings)
    assert len([*(begun / "shards").iterdir()]) == 2


@pytest.mark.parametrize("content", NO_ORIGIN.values(), ids=NO_ORIGIN)
def test_a_damaged_stamp_is_written_again_and_shards_are_kept(begun, settings, capsys, content) -> None:
    stamp = begun / "settings.json"
    before = stamp.read_bytes()
    stamp.write_bytes(content)
    assert take_over(begun, settings) == 2
    assert stamp.read_bytes() == before
    printed = capsys.readouterr().out
    assert f"{stamp} is damaged" in printed
    assert "2 whole shards of this dataset are kept" in printed


@pytest.mark.parametrize(
    "change",
    [
        lambda stamp: stamp["settings"].update(episodes=7),
        lambda stamp: stamp["settings"].update(episodes="three"),
        lambda stamp: stamp["settings"].pop("episodes"),
        lambda stamp: stamp["versions"].update(mujoco="1.2.3"),
        lambda stamp: stamp["versions"].update(mujoco=3),
        lambda stamp: stamp.update(versions=[]),
    ],
)
def test_whole_shards_are_believed_rather_than_a_stamp_that_was_altered(begun, settings, change) -> None:
    stamp = begun / "settings.json"
    before = stamp.read_bytes()
    stamp.write_bytes(edited(before, change))
    assert take_over(begun, settings) == 2
    assert stamp.read_bytes() == before


@pytest.mark.parametrize("content", [*NO_ORIGIN.values(), None], ids=[*NO_ORIGIN, "missing"])
def test_shards_of_other_settings_are_kept_when_their_stamp_is_lost(begun, settings, content) -> None:
    if content is None:
        (begun / "settings.json").unlink()
    else:
        (begun / "settings.json").write_bytes(content)
    with pytest.raises(DatasetError, match="other settings or versions: episodes is 4, not 5"):
        take_over(begun, replace(settings, episodes=5))
    assert take_over(begun, settings) == 2


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (lambda stamp: stamp["settings"].update(episodes=5), "episodes is 5, not 4"),
        (lambda stamp: stamp["versions"].update(mujoco="1.2.3"), r"mujoco is 1\.2\.3, not "),
        (lambda stamp: stamp["versions"].pop("lerobot"), "lerobot is none, not "),
    ],
)
def test_an_unfinished_dataset_of_another_origin_is_refused(begun, settings, change, difference) -> None:
    shutil.rmtree(begun / "shards")
    stamp = begun / "settings.json"
    stamp.write_bytes(edited(stamp.read_bytes(), change))
    with pytest.raises(
        DatasetError, match=f"{begun} holds a dataset of other settings or versions: {difference}"
    ):
        take_over(begun, settings)


# -- report.json --------------------------------------------------------------------------------------------


def rewrite_report(shard: Path, change: Callable[[dict], object]) -> None:
    report = shard / "report.json"
    report.write_bytes(edited(report.read_bytes(), change))


@pytest.mark.parametrize(
    "damage",
    [
        *(
            (lambda shard, content=content: (shard / "report.json").write_bytes(content))
            for content in NO_ORIGIN.values()
        ),
        lambda shard: (shard / "report.json").unlink(),
        lambda shard: rewrite_report(shard, lambda report: report.update(episodes=7)),
        lambda shard: rewrite_report(shard, lambda report: report.pop("skipped")),
        lambda shard: rewrite_report(shard, lambda report: report["episodes"][0].update(seed="0")),
        lambda shard: rewrite_report(shard, lambda report: report["episodes"][0].update(seed=-1)),
        lambda shard: rewrite_report(shard, lambda report: report["episodes"][0].update(task=None)),
        lambda shard: rewrite_report(shard, lambda report: report["episodes"][0].pop("split")),
        lambda shard: rewrite_report(shard, lambda report: report["episodes"].append([])),
        lambda shard: rewrite_report(shard, lambda report: report.update(versions=None)),
    ],
)
@pytest.mark.parametrize("hashes_are_right", [False, True])
def test_a_shard_with_a_strange_report_is_named(begun, settings, damage, hashes_are_right) -> None:
    damage(begun / "shards/000001")
    if hashes_are_right:
        write_sums(begun / "shards/000001")
    with pytest.raises(DamagedShard, match=f"shard 000001 in {begun / 'shards'}: "):
        take_over(begun, settings)


# -- what does not belong there -----------------------------------------------------------------------------


def mistake(path: Path, content: str) -> Path:
    path.write_text(content)
    return path


@pytest.mark.parametrize("name", ["notes.txt", "shards/notes.txt", "shards/000000.bak"])
def test_files_of_somebody_else_are_refused_and_left_alone(begun, settings, name) -> None:
    stray = mistake(begun / name, "mine")
    with pytest.raises(DatasetError, match=f"{stray} was not made by this command: move it away"):
        take_over(begun, settings)
    assert stray.read_text() == "mine"
    stray.unlink()
    assert take_over(begun, settings) == 2


@pytest.mark.parametrize("name", ["lock", "settings.json", "shards", "shards/000000"])
def test_no_link_is_followed(begun, settings, tmp_path, name) -> None:
    precious = tmp_path / "precious"
    if (begun / name).is_dir():
        (begun / name).rename(precious)
    else:
        (begun / name).unlink()
        precious.write_text("precious")
    (begun / name).symlink_to(precious)
    with pytest.raises(DatasetError, match=f"{begun / name} was not made by this command"):
        take_over(begun, settings)
    assert precious.is_dir() or precious.read_text() == "precious"


def test_what_killed_runs_left_is_removed_and_no_link_in_it_followed(begun, settings, tmp_path) -> None:
    precious = tmp_path / "precious"
    precious.mkdir()
    mistake(precious / "photo", "of a cat")
    (begun / "tmp-1" / "frames").mkdir(parents=True)
    (begun / "tmp-1" / "link").symlink_to(precious)
    mistake(begun / "tmp-2", "half a file")
    assert take_over(begun, settings) == 2
    assert not list(begun.glob("tmp-*"))
    assert (precious / "photo").read_text() == "of a cat"


# -- where a dataset can be ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("root", "message"),
    [
        ("/", "/ is where a disk is mounted.* choose a folder in it, for example --root=/dataset"),
        ("/proc", "/proc is where a disk is mounted"),
        ("/proc/dataset", r"cannot write /proc/dataset\.partial: No such file or directory"),
        ("file/dataset", "cannot make .*file/dataset: .*file is a file and not a folder"),
        ("file/in/dataset", "file is a file and not a folder"),
        ("n" * 250, "cannot write .*: File name too long"),
    ],
)
def test_a_root_where_no_dataset_can_be_is_refused_before_the_work(settings, tmp_path, root, message) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match=message), Staging(tmp_path / root, settings):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_staging_folder_that_is_a_link_is_refused(settings, tmp_path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "begun.partial").symlink_to(tmp_path / "elsewhere")
    with (
        pytest.raises(DatasetError, match=r"begun\.partial is a link"),
        Staging(tmp_path / "begun", settings),
    ):
        pass
    assert not any((tmp_path / "elsewhere").iterdir())


@pytest.mark.parametrize("exists", [False, True])
def test_a_root_that_is_a_link_is_the_folder_that_it_leads_to(settings, tmp_path, exists) -> None:
    place = tmp_path / "disk" / "real"
    place.parent.mkdir()
    if exists:
        place.mkdir()
    (tmp_path / "link").symlink_to(place)
    with Staging(tmp_path / "link", settings) as staging, new_folder(staging.folder) as folder:
        assert not staging.is_published()
        mistake(folder / "card", "content")
        staging.publish(folder)
    assert (tmp_path / "link").is_symlink()
    assert (place / "card").read_text() == "content"
    assert [path.name for path in place.parent.iterdir()] == ["real"]


def test_a_refusal_is_not_taken_for_a_full_disk(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("lerobot_env_bimanual.generation.staging.ALMOST_FULL_BYTES", 2**60)
    with (
        pytest.raises(DatasetError, match=r"cannot write .*: Permission denied"),
        plain_write_errors(tmp_path),
    ):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(DatasetError, match="no space left"), plain_write_errors(tmp_path):
        raise RuntimeError("an image writer that says nothing about the disk")
