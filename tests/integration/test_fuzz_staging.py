"""Whatever stands in the files of a staging folder or a recipe: it is taken, or refused in one sentence; nothing is lost."""

import contextlib
import copy
import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lerobot_bimanual.checksums import write_sums
from lerobot_bimanual.dataset.provenance import EpisodeKey, Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.versions import installed_versions
from lerobot_env_bimanual.commands.dataset_generate import settings_of
from lerobot_env_bimanual.commands.dataset_regenerate import DatasetRegenerateConfig, dataset_regenerate
from lerobot_env_bimanual.generation.plan import ShardReport, next_round
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard_report import DamagedShard, write_report
from lerobot_env_bimanual.generation.staging import Staging

pytestmark = pytest.mark.fuzz

VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
JSON = VALUES | st.lists(VALUES, max_size=3) | st.dictionaries(st.text(max_size=8), VALUES, max_size=3)


def changed(right: bytes, data: st.DataObject) -> bytes:
    """A file with other bytes somewhere, or with another value or none in some place of its JSON."""
    if data.draw(st.booleans()):
        start = data.draw(st.integers(0, len(right)))
        return (
            right[:start] + data.draw(st.binary(max_size=4)) + right[start + data.draw(st.integers(0, 20)) :]
        )
    content = copy.deepcopy(json.loads(right))
    container, key = content, data.draw(st.sampled_from(sorted(content)))
    while isinstance(inner := container[key], dict | list) and inner and data.draw(st.integers(0, 3)):
        container, key = (
            inner,
            data.draw(st.sampled_from([*inner] if isinstance(inner, dict) else range(len(inner)))),
        )
    if data.draw(st.booleans()):
        del container[key]
    else:
        container[key] = data.draw(JSON)
    return json.dumps(content).encode()


@pytest.fixture(scope="module")
def settings(small_generation, tmp_path_factory) -> GenerationSettings:
    return settings_of(
        small_generation(tmp_path_factory.mktemp("settings") / "begun", episodes=2, episodes_per_shard=1)
    )


@pytest.fixture(scope="module")
def right(settings, tmp_path_factory) -> Path:
    """Staging folder with two finished shards, one of them a report alone."""
    with Staging(tmp_path_factory.mktemp("right") / "begun", settings) as staging:
        for shard in next_round(settings, [], 0):
            staging.shard_folder(shard.name).mkdir()
            write_report(staging.shard_folder(shard.name), settings, ShardReport(shard.candidates, ()))
    return staging.folder


@pytest.fixture
def begun(right, tmp_path):
    """Makes a fresh copy for every example."""

    def copy_it() -> Path:
        shutil.rmtree(tmp_path / "begun.partial", ignore_errors=True)
        return Path(shutil.copytree(right, tmp_path / "begun.partial"))

    return copy_it


@given(data=st.data())
def test_no_shard_is_lost_over_a_stamp(begun, settings, right, data) -> None:
    folder = begun()
    (folder / "settings.json").write_bytes(changed((right / "settings.json").read_bytes(), data))
    with Staging(folder.with_suffix(""), settings) as staging:
        assert all(staging.report(shard) for shard in next_round(settings, [], 0))
    after, before = (json.loads((place / "settings.json").read_bytes()) for place in (folder, right))
    assert after | before == after


@given(data=st.data())
def test_a_stamp_without_shards_is_believed_or_written_again(begun, settings, data) -> None:
    folder = begun()
    shutil.rmtree(folder / "shards")
    (folder / "settings.json").write_bytes(changed((folder / "settings.json").read_bytes(), data))
    with contextlib.suppress(BimanualError), Staging(folder.with_suffix(""), settings):
        assert json.loads((folder / "settings.json").read_text())["settings"] == json.loads(
            json.dumps(settings.to_dict())
        )


@given(data=st.data(), hashes_are_right=st.booleans())
def test_a_strange_report_is_that_of_a_damaged_shard(begun, settings, data, hashes_are_right) -> None:
    folder = begun()
    report = folder / "shards/000001/report.json"
    before = json.loads(report.read_bytes())
    report.write_bytes(changed(report.read_bytes(), data))
    if hashes_are_right:
        write_sums(report.parent)
    first, second = next_round(settings, [], 0)
    with Staging(folder.with_suffix(""), settings) as staging:
        assert staging.report(first) is not None
        with contextlib.suppress(DamagedShard):
            assert staging.report(second) == ShardReport(second.candidates, ())
            assert json.loads(report.read_bytes()) | before == json.loads(report.read_bytes())


class Began(Exception):
    """Everything was read; making the dataset would be next."""


@given(data=st.data())
def test_a_recipe_is_followed_or_refused(settings, tmp_path, monkeypatch, data) -> None:
    def make_dataset(asked: GenerationSettings, *_) -> None:
        assert isinstance(asked.total_episodes, int)
        raise Began

    monkeypatch.setattr("lerobot_env_bimanual.commands.dataset_generate.make_dataset", make_dataset)
    key = EpisodeKey("lift_ball", 0, "train", 0)
    origin = Provenance(
        SCHEMA_VERSION, "frames", installed_versions(), {}, settings.to_dict(), "ls", [key], []
    )
    (tmp_path / "meta").mkdir(exist_ok=True)
    origin.write(tmp_path)
    recipe = tmp_path / "meta/bimanual.json"
    recipe.write_bytes(changed(recipe.read_bytes(), data))
    with contextlib.suppress(BimanualError, Began):
        dataset_regenerate(DatasetRegenerateConfig(provenance=recipe, root=tmp_path / "never", workers=1))
    assert not (tmp_path / "never").exists()
