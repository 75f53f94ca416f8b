"""LeRobot's other tools take our datasets; where one cannot, the test says what it does instead."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset
from lerobot.scripts import lerobot_edit_dataset

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset

pytestmark = [pytest.mark.weekly, pytest.mark.timeout(900)]

RGB, DEPTH = schema.image_key("front"), schema.depth_key("front")
REENCODED = 0.01
"""Mean error of RGB, of 1, that encoding a video once more at the same quality may cost."""


@pytest.fixture
def edit(monkeypatch):
    """Runs `lerobot-edit-dataset`, in this process because importing LeRobot takes longer than an edit."""

    def run_edit(operation: str, *flags: str, **options: object) -> None:
        words = [f"--operation.{name}={json.dumps(value)}" for name, value in options.items()]
        monkeypatch.setattr(sys, "argv", ["edit", f"--operation.type={operation}", *flags, *words])
        lerobot_edit_dataset.main()

    return run_edit


def rows_of(root: Path, episode: int) -> slice:
    lengths = [len(recorded) for recorded in RecordedDataset(root).episodes()]
    return slice(sum(lengths[:episode]), sum(lengths[: episode + 1]))


def assert_episodes(edited: Path, original: Path, expected: list[int]) -> None:
    """`edited` holds the expected episodes of `original`, with all vectors, scalars and depth as they were."""
    before, after = RecordedDataset(original), RecordedDataset(edited)
    assert after.view == before.view
    assert after.provenance is None  # LeRobot's tools copy its own files alone
    assert len(after) == len(expected)
    images, images_before = LeRobotDataset("x/y", root=edited), LeRobotDataset("x/y", root=original)
    assert images.num_frames == sum(len(recorded) for recorded in after.episodes())
    for recorded, episode in zip(after.episodes(), expected, strict=True):
        wanted = before.episode(episode)
        assert recorded.meta == wanted.meta
        for key, column in wanted.columns.items():
            assert np.array_equal(recorded.columns[key], column), key
        rows, rows_before = rows_of(edited, recorded.index), rows_of(original, episode)
        for row, row_before in ((rows.start, rows_before.start), (rows.stop - 1, rows_before.stop - 1)):
            found, stored = images[row], images_before[row_before]
            assert np.array_equal(found[DEPTH], stored[DEPTH])
            assert np.abs(found[RGB] - stored[RGB]).mean() <= (REENCODED if before.view == "frames" else 0)


@pytest.mark.parametrize("view", schema.VIEWS)
def test_a_dataset_is_split_and_merged_again(generated, tmp_path, edit, view) -> None:
    place = (f"--root={generated / view}", "--repo_id=local/small")
    edit("split", *place, f"--new_root={tmp_path}", splits={"even": [0, 2], "odd": [1]})
    parts = [tmp_path / "even", tmp_path / "odd"]
    assert_episodes(parts[0], generated / view, [0, 2])
    assert_episodes(parts[1], generated / view, [1])
    whole = ("--new_repo_id=local/whole", f"--new_root={tmp_path / 'whole'}")
    edit("merge", *whole, repo_ids=["local/even", "local/odd"], roots=[str(part) for part in parts])
    assert_episodes(tmp_path / "whole", generated / view, [0, 2, 1])


def test_episodes_are_deleted_and_features_removed(generated, tmp_path, edit) -> None:
    place = (f"--root={generated / 'keyframes'}", "--repo_id=local/small", "--new_repo_id=local/fewer")
    edit("delete_episodes", *place, f"--new_root={tmp_path / 'fewer'}", episode_indices=[0])
    assert_episodes(tmp_path / "fewer", generated / "keyframes", [1, 2])
    place = (f"--root={generated / 'frames'}", "--repo_id=local/small", "--new_repo_id=local/lean")
    wrist = [schema.image_key("left_wrist"), schema.depth_key("left_wrist")]
    edit("remove_feature", *place, f"--new_root={tmp_path / 'lean'}", feature_names=wrist)
    assert RecordedDataset(tmp_path / "lean").cameras == ("front",)
    assert_episodes(tmp_path / "lean", generated / "frames", [0, 1, 2])


def test_streaming_gives_the_rows_that_are_stored(generated) -> None:
    """Of the view keyframes; that of frames needs FFmpeg on the machine and one file per video."""
    place = {"repo_id": "local/small", "root": generated / "keyframes"}
    stored = LeRobotDataset(**place)
    stream = StreamingLeRobotDataset(**place, shuffle=False, buffer_size=1, max_num_shards=1)
    rows = []
    for item in stream:
        rows.append(int(item["index"]))
        for key, value in stored[rows[-1]].items():
            assert np.array_equal(np.asarray(item[key]), np.asarray(value)), key
    assert sorted(rows) == list(range(len(stored)))
