"""LeRobot reads what was written; an unfinished dataset is refused; merging equals LeRobot's own function."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from lerobot.datasets.aggregate import aggregate_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.utils.feature_utils import dataset_to_policy_features

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.merging import merge_datasets
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.dataset.views import row_columns, rows_of_view
from lerobot_bimanual.dataset.writer import ViewWriter, write_episode
from lerobot_bimanual.errors import DatasetError

CAMERAS = ("front", "left_wrist")
SIZE = (24, 32)
TICKS = 21
KEYFRAME_ROWS = 5


@pytest.mark.parametrize(("view", "rows"), [("frames", TICKS), ("keyframes", KEYFRAME_ROWS)])
def test_lerobot_loads_what_was_written_and_our_reader_decodes_the_same(
    datasets, make_episode, calibration, view: schema.View, rows: int
) -> None:
    dataset = LeRobotDataset("local/test", root=datasets[view], video_backend="pyav")
    assert (len(dataset), dataset.num_episodes) == (2 * rows, 2)
    assert dataset.fps == (20 if view == "frames" else 1)  # LeRobot's timestamps of keyframes count rows
    read_by_policies = dataset_to_policy_features(dataset.meta.features)
    assert [key for key in read_by_policies if key.startswith("action")] == ["action"]
    assert dataset.meta.robot_type == schema.ROBOT_TYPE
    episode, reader = make_episode(1), ImageReader(datasets[view])
    decoded = {key: [*reader.images(1, key)] for key in reader.shapes}
    assert {*map(len, decoded.values())} == {rows}
    _, ours = RecordedDataset(datasets[view]).episodes()
    assert (ours.meta, len(ours)) == (episode.meta, rows)
    for position, row in enumerate(rows_of_view(episode, view, (0.5,))):
        item = dataset[rows + position]
        assert isinstance(item, dict)
        assert item["task"] == "lift the ball"
        for key, value in calibration.row_without_calibration(row_columns(episode, row, view)).items():
            assert np.array_equal(np.atleast_1d(item[key]), np.atleast_1d(value)), (row, key)
            assert np.array_equal(ours.columns[key][position], np.squeeze(value)), (row, key)
        for camera in CAMERAS:
            images = episode.images(row)
            depth = item[schema.depth_key(camera)].numpy()
            assert (depth.dtype, depth.shape) == (np.float32, (1, *SIZE))
            assert np.abs(depth - images[schema.depth_key(camera)]).max() <= 0.5
            rgb = np.moveaxis(item[schema.image_key(camera)].numpy() * 255, 0, -1)
            error = np.abs(rgb - images[schema.image_key(camera)])
            assert np.array_equal(decoded[schema.image_key(camera)][position], np.rint(rgb))
            assert np.array_equal(decoded[schema.depth_key(camera)][position], depth[0])
            assert error.max() < 1e-3 if view == "keyframes" else error.mean() < 4


def test_each_row_is_rendered_once_however_many_views_store_it(tmp_path, make_episode) -> None:
    episode, asked = make_episode(0), []
    counted = replace(episode, images=lambda row: asked.append(row) or episode.images(row))
    with ViewWriter(tmp_path / "keyframes", "local/x", "keyframes", CAMERAS, *SIZE) as keyframes:
        write_episode(counted, [keyframes])
        assert asked == [0, 12, TICKS]
        asked.clear()
        with ViewWriter(tmp_path / "frames", "local/x", "frames", CAMERAS, *SIZE) as frames:
            write_episode(counted, [frames, keyframes])
    assert asked == list(range(TICKS + 1))


def test_the_calibration_is_stored_once_in_the_metadata_and_a_row_with_another_one_is_refused(
    datasets, make_episode, calibration, tmp_path
) -> None:
    dataset = RecordedDataset(datasets["keyframes"])
    assert dataset.calibration == calibration
    columns = dataset.episode(0).columns
    assert columns[schema.WRIST_EXTRINSICS].shape[1:] == (32,)  # of the two wrists
    assert schema.CAMERA_INTRINSICS not in columns
    seen, last = make_episode(0), make_episode(0).final_observation[schema.CAMERA_EXTRINSICS]
    last[47] += 1e-6
    moved = replace(seen, final_observation=seen.final_observation | {schema.CAMERA_EXTRINSICS: last})
    with ViewWriter(tmp_path / "x", "a/x", "keyframes", CAMERAS, *SIZE, calibration=calibration) as writer:
        write_episode(seen, [writer])
        with pytest.raises(DatasetError, match="the calibration of a row differs"):
            write_episode(moved, [writer])


@pytest.mark.parametrize("view", schema.VIEWS)
def test_an_unfinished_dataset_is_refused(tmp_path, make_episode, view: schema.View) -> None:
    root = tmp_path / view
    with pytest.raises(KeyboardInterrupt), ViewWriter(root, "local/x", view, CAMERAS, *SIZE) as writer:  # noqa: PT012
        write_episode(make_episode(0), [writer])
        writer.add_row(make_episode(1), 0, make_episode(1).images(0))
        raise KeyboardInterrupt
    with pytest.raises(DatasetError, match="no episodes"):
        RecordedDataset(root)


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
def test_merging_gives_the_dataset_that_lerobot_gives_and_leaves_the_sources_unchanged(
    sources, tmp_path
) -> None:
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
