"""Shards that are damaged, foreign, or cannot be written are noticed, named and never merged."""

import errno
import hashlib
import json
import shutil
from pathlib import Path

import pytest

from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.dataset_generate import make_dataset, settings_of

pytestmark = pytest.mark.sim

SUMS_FILE = "SHA256SUMS"


@pytest.fixture(scope="module")
def options(small_generation):
    """Options of a dataset of two shards with one episode each."""

    def build(root: Path):
        return small_generation(root, view="keyframes", episodes=2, episodes_per_shard=1)

    return build


@pytest.fixture(scope="module")
def half_done(options, records_here, tmp_path_factory) -> Path:
    """Staging folder of a run that was interrupted with both shards recorded, before merging."""
    config = options(tmp_path_factory.mktemp("half") / "small")
    with pytest.raises(KeyboardInterrupt):
        make_dataset(settings_of(config), config.root, records_here(patience=2))
    return config.root.with_name("small.partial")


@pytest.fixture
def begun(options, half_done, tmp_path):
    """Options and shard folder of a run of one's own that was interrupted before merging."""
    shutil.copytree(half_done, tmp_path / "small.partial")
    return options(tmp_path / "small"), tmp_path / "small.partial" / "shards"


def cut_a_table(shards: Path) -> None:
    table = shards / "000001/keyframes/data/chunk-000/file-000.parquet"
    table.write_bytes(table.read_bytes()[:-100])


def flip_a_bit_of_a_table(shards: Path) -> None:
    table = shards / "000001/keyframes/data/chunk-000/file-000.parquet"
    content = bytearray(table.read_bytes())
    content[len(content) // 2] ^= 1
    table.write_bytes(content)


def lose_the_metadata(shards: Path) -> None:
    (shards / "000001/keyframes/meta/info.json").unlink()


def lose_the_sums(shards: Path) -> None:
    (shards / "000001" / SUMS_FILE).unlink()


def garble_the_sums(shards: Path) -> None:
    (shards / "000001" / SUMS_FILE).write_bytes(b"\xff\xfe nothing that is a list")


def add_a_file(shards: Path) -> None:
    (shards / "000001/keyframes/data/chunk-000/file-001.parquet").write_bytes(b"more")


def change_the_report(shards: Path) -> None:
    report = shards / "000001/report.json"
    report.write_text(report.read_text().replace('"seed": 1', '"seed": 5'))


def copy_another_shard(shards: Path) -> None:
    shutil.rmtree(shards / "000001")
    shutil.copytree(shards / "000000", shards / "000001")


def change_the_report_and_its_sum(shards: Path, old: str, new: str) -> None:
    """As somebody who recorded something else would have written it: every hash is right."""
    report, sums = shards / "000001/report.json", shards / "000001" / SUMS_FILE
    before = hashlib.sha256(report.read_bytes()).hexdigest()
    report.write_text(report.read_text().replace(old, new))
    sums.write_text(sums.read_text().replace(before, hashlib.sha256(report.read_bytes()).hexdigest()))


def bring_a_shard_of_other_settings(shards: Path) -> None:
    change_the_report_and_its_sum(shards, '"height": 24', '"height": 48')


def bring_a_shard_of_no_settings(shards: Path) -> None:
    change_the_report_and_its_sum(shards, '"height": 24', '"height": "tall"')


def bring_a_shard_of_another_version(shards: Path) -> None:
    versions = json.loads((shards / "000001/report.json").read_text())["versions"]
    change_the_report_and_its_sum(shards, f'"mujoco": "{versions["mujoco"]}"', '"mujoco": "9"')


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (cut_a_table, "keyframes/data/chunk-000/file-000.parquet has changed"),
        (flip_a_bit_of_a_table, "keyframes/data/chunk-000/file-000.parquet has changed"),
        (lose_the_metadata, "keyframes/meta/info.json is missing"),
        (lose_the_sums, "SHA256SUMS is missing"),
        (garble_the_sums, "SHA256SUMS is damaged"),
        (add_a_file, "keyframes/data/chunk-000/file-001.parquet does not belong here"),
        (change_the_report, "report.json has changed"),
        (copy_another_shard, "it holds the candidates "),
        (bring_a_shard_of_other_settings, "recorded with other settings or versions: height is 48, not 24"),
        (bring_a_shard_of_no_settings, "height is 'tall', but must be"),
        (bring_a_shard_of_another_version, "mujoco is 9, not "),
    ],
)
def test_a_shard_that_is_not_as_it_was_finished_is_named_and_recorded_again(
    begun, records_here, capsys, damage, reason
) -> None:
    config, shards = begun
    damage(shards)
    executor = records_here(patience=1)
    with pytest.raises(KeyboardInterrupt):
        make_dataset(settings_of(config), config.root, executor)
    assert executor.recorded == ["000001"]
    printed = capsys.readouterr().out
    assert f"shard 000001 in {shards}: " in printed
    assert reason in printed


def test_a_finished_shard_is_taken_over_and_its_dataset_published(begun, records_here) -> None:
    config, shards = begun
    cut_a_table(shards)
    executor = records_here()
    make_dataset(settings_of(config), config.root, executor)
    assert executor.recorded == ["000001"]
    assert len(list((config.root / "data").rglob("*.parquet"))) == 2
    provenance = json.loads((config.root / "meta/bimanual.json").read_text())
    assert [episode["seed"] for episode in provenance["episodes"]] == [0, 1]
    assert not shards.parent.exists()


def test_a_disk_that_damages_what_was_just_written_stops_the_run(begun, records_here) -> None:
    config, shards = begun
    cut_a_table(shards)
    executor = records_here(after=cut_a_table)
    with pytest.raises(DatasetError, match="shard 000001"):
        make_dataset(settings_of(config), config.root, executor)
    assert executor.recorded == ["000001"]
    assert (shards / "000000").exists()
    assert not config.root.exists()


def test_a_full_disk_is_one_clear_error_and_keeps_what_is_finished(begun, records_here, monkeypatch) -> None:
    config, shards = begun
    kept = (shards / "000000" / SUMS_FILE).read_bytes()
    shutil.rmtree(shards / "000001")

    def end_episode(_: ViewWriter) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ViewWriter, "end_episode", end_episode)
    with pytest.raises(DatasetError, match=r"no space left on the disk of .*000001; free some and repeat"):
        make_dataset(settings_of(config), config.root, records_here())
    assert (shards / "000000" / SUMS_FILE).read_bytes() == kept
    assert [path.name for path in shards.iterdir()] == ["000000"]
    assert not list(shards.parent.glob("tmp-*"))


def test_a_disk_that_turned_read_only_is_one_clear_error(begun, records_here, monkeypatch) -> None:
    config, shards = begun
    shutil.rmtree(shards / "000001")

    def mkdtemp(*_, **__) -> str:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("tempfile.mkdtemp", mkdtemp)
    with pytest.raises(DatasetError, match=r"cannot write .*Read-only file system"):
        make_dataset(settings_of(config), config.root, records_here())
    assert (shards / "000000").exists()
