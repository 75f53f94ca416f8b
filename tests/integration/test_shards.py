"""Shards that are damaged, foreign, or cannot be written are noticed, named and never merged."""

import errno
import json
import shutil
from pathlib import Path

import pytest
from lerobot_env_bimanual.generation.building import build_dataset
from lerobot_env_bimanual.generation.candidates import Shard, ShardReport, next_round
from lerobot_env_bimanual.generation.merging import merge_shards
from lerobot_env_bimanual.generation.sealing import SUMS_FILE, BrokenSeal, seal
from lerobot_env_bimanual.generation.shards import make_recorder, record_shard

from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.generate import regeneration_command
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import Staging

pytestmark = pytest.mark.sim


class Here:
    """An executor that works in the calling process and keeps a list of what it was asked to record."""

    def __init__(self):
        self.recorded: list[str] = []
        self.successes = 0
        self.cpu_seconds = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        pass

    def record(self, settings, shards, folder):
        for shard in shards:
            record_here(settings, shard, folder(shard.name))
            self.recorded.append(shard.name)
            self.successes += len(shard.candidates)
            yield

    def merge(self, jobs):
        for job in jobs:
            merge_shards(job)
            yield


def record_here(settings: GenerationSettings, shard: Shard, folder: Path) -> None:
    recorder = make_recorder(settings, shard.candidates[0].task)
    record_shard(settings, shard, recorder, folder, lambda: None)
    recorder.close()


@pytest.fixture(scope="module")
def options(small_generation):
    """Options of a dataset of two shards with one episode each."""

    def build(root: Path):
        return small_generation(root, view="keyframes", episodes=2, episodes_per_shard=1)

    return build


@pytest.fixture(scope="module")
def half_done(options, tmp_path_factory) -> Path:
    """Staging folder with both shards recorded, not yet merged."""
    config = options(tmp_path_factory.mktemp("half") / "small")
    settings = GenerationSettings.parse(config)
    with Staging(config.root, settings) as staging:
        for shard in next_round(settings, [], 0):
            record_here(settings, shard, staging.shard_folder(shard.name))
        return staging.folder


@pytest.fixture
def begun(options, half_done, tmp_path):
    """Options, settings and shard folder of a run of one's own that was interrupted before merging."""
    config = options(tmp_path / "small")
    shutil.copytree(half_done, tmp_path / "small.partial")
    return config, GenerationSettings.parse(config), tmp_path / "small.partial" / "shards"


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


def bring_a_shard_of_other_settings(shards: Path) -> None:
    folder = shards / "000001"
    content = json.loads((folder / "report.json").read_text())
    settings = GenerationSettings.from_dict(content["settings"] | {"height": 48})
    seal(folder, settings, ShardReport(next_round(settings, [], 0)[1].candidates, ()))  # every hash is right


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (cut_a_table, "keyframes/data/chunk-000/file-000.parquet has changed"),
        (flip_a_bit_of_a_table, "keyframes/data/chunk-000/file-000.parquet has changed"),
        (lose_the_metadata, "keyframes/meta/info.json is missing"),
        (lose_the_sums, "SHA256SUMS cannot be read"),
        (garble_the_sums, "SHA256SUMS cannot be read"),
        (add_a_file, "keyframes/data/chunk-000/file-001.parquet does not belong to it"),
        (change_the_report, "report.json has changed"),
        (copy_another_shard, r"it holds the candidates .* not .*"),
        (bring_a_shard_of_other_settings, "recorded with other settings: height is 48, not 24"),
    ],
)
def test_a_shard_that_is_not_as_it_was_sealed_is_named(begun, damage, reason) -> None:
    config, settings, shards = begun
    whole, broken = next_round(settings, [], 0)
    damage(shards)
    with Staging(config.root, settings) as staging:
        found = staging.report(whole)
        assert found is not None
        assert found.episodes == whole.candidates
        with pytest.raises(BrokenSeal, match=f"shard 000001 in {shards}: {reason}"):
            staging.report(broken)


def test_a_shard_of_other_versions_is_named(begun, monkeypatch) -> None:
    config, settings, _ = begun
    with Staging(config.root, settings) as staging:
        monkeypatch.setattr(
            "lerobot_env_bimanual.generation.sealing.installed_versions", lambda: {"mujoco": "9"}
        )
        with pytest.raises(BrokenSeal, match=r"but installed are \{'mujoco': '9'\}"):
            staging.report(next_round(settings, [], 0)[0])


def test_damaged_shards_are_reported_and_recorded_again(begun, capsys) -> None:
    config, settings, shards = begun
    cut_a_table(shards)
    executor = Here()
    with Staging(config.root, settings) as staging:
        reports = build_dataset(settings, regeneration_command(settings, config.root), staging, executor)
    assert executor.recorded == ["000001"]
    assert "shard 000001" in capsys.readouterr().out
    assert [episode.seed for report in reports for episode in report.episodes] == [0, 1]
    tables = sorted((config.root / "data").rglob("*.parquet"))
    assert len(tables) == 2
    assert not shards.parent.exists()


def test_a_disk_that_damages_what_was_just_written_stops_the_run(begun) -> None:
    config, settings, shards = begun
    cut_a_table(shards)

    class Careless(Here):
        def record(self, settings, missing, folder):
            yield from super().record(settings, missing, folder)
            cut_a_table(shards)

    executor = Careless()
    with pytest.raises(BrokenSeal, match="shard 000001"), Staging(config.root, settings) as staging:
        build_dataset(settings, "", staging, executor)
    assert executor.recorded == ["000001"]
    assert (shards / "000000").exists()
    assert not config.root.exists()


def test_a_full_disk_is_one_clear_error_and_keeps_what_is_finished(begun, monkeypatch) -> None:
    config, settings, shards = begun
    kept = (shards / "000000" / SUMS_FILE).read_bytes()
    shutil.rmtree(shards / "000001")

    def end_episode(_: ViewWriter) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ViewWriter, "end_episode", end_episode)
    with (
        pytest.raises(DatasetError, match=r"no space left on the disk of .*000001; free some and repeat"),
        Staging(config.root, settings) as staging,
    ):
        build_dataset(settings, "", staging, Here())
    assert (shards / "000000" / SUMS_FILE).read_bytes() == kept
    assert [path.name for path in shards.iterdir()] == ["000000"]
    assert not list(shards.parent.glob("tmp-*"))


def test_a_disk_that_turned_read_only_is_one_clear_error(begun, monkeypatch) -> None:
    config, settings, shards = begun
    shutil.rmtree(shards / "000001")

    def mkdtemp(*_, **__) -> str:
        raise OSError(errno.EROFS, "Read-only file system")

    with Staging(config.root, settings) as staging:
        monkeypatch.setattr("tempfile.mkdtemp", mkdtemp)
        with pytest.raises(DatasetError, match=r"cannot write .*Read-only file system"):
            build_dataset(settings, "", staging, Here())
    assert (shards / "000000").exists()
