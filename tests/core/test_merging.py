"""Merging gives what LeRobot's own function gives, and takes no file of the sources away."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from lerobot.datasets.aggregate import aggregate_datasets

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.merging import merge_datasets
from lerobot_bimanual.errors import DatasetError


@pytest.fixture(params=schema.VIEWS)
def sources(request, write_view, tmp_path) -> list[Path]:
    """Three datasets of one, two and one episodes."""
    seeds = {"a": (0,), "b": (1, 2), "c": (3,)}
    return [write_view(tmp_path / name, request.param, *of_source) for name, of_source in seeds.items()]


def contents(root: Path) -> dict[str, object]:
    """What every file says, by its path: values and row groups of tables, JSON, bytes of videos."""
    found = {}
    for path in sorted(root.rglob("*")):
        if path.suffix == ".parquet":
            file = pq.ParquetFile(path)
            groups = [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)]
            found[str(path.relative_to(root))] = file.read().to_pydict(), groups
        elif path.suffix == ".json":
            found[str(path.relative_to(root))] = json.loads(path.read_text())
        elif path.is_file():
            found[str(path.relative_to(root))] = path.read_bytes()
    return found


@pytest.mark.slow
def test_the_result_is_that_of_lerobot_and_the_sources_stay_as_they_are(sources, tmp_path) -> None:
    before = [contents(source) for source in sources]
    merge_datasets(sources, tmp_path / "ours")
    assert [contents(source) for source in sources] == before
    aggregate_datasets(
        ["local/part"] * len(sources),
        "local/whole",
        roots=sources,
        aggr_root=tmp_path / "theirs",
        concatenate_videos=False,
        concatenate_data=False,
    )
    ours, theirs = contents(tmp_path / "ours"), contents(tmp_path / "theirs")
    assert ours.keys() == theirs.keys()
    for path in ours:
        assert ours[path] == theirs[path], path


def test_tables_keep_their_types(sources, tmp_path) -> None:
    """LeRobot's function loses the lengths of vectors on the way."""
    merge_datasets(sources, tmp_path / "whole")
    for kind in ("data", "meta/episodes"):
        wanted = pq.read_schema(next(sources[0].glob(f"{kind}/*/*.parquet")))
        features = json.loads((wanted.metadata or {}).get(b"huggingface", b"{}")).get("info")
        for path in (tmp_path / "whole").glob(f"{kind}/*/*.parquet"):
            found = pq.read_schema(path)
            assert found.equals(wanted)
            if features:
                assert json.loads(found.metadata[b"huggingface"]) == {"info": features}


@pytest.mark.parametrize("view", schema.VIEWS)
def test_datasets_of_different_features_are_refused(datasets, write_view, tmp_path, view) -> None:
    other = write_view(tmp_path / "other", view, 4, cameras=("front",))
    with pytest.raises(DatasetError, match="differ in features"):
        merge_datasets([datasets[view], other], tmp_path / "whole")
    assert not (tmp_path / "whole").exists()
