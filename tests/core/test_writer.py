"""What LeRobot reads is what was written, and a broken-off dataset is noticed."""

from dataclasses import replace

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
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
    datasets, make_episode, view: schema.View, rows: int
) -> None:
    dataset = LeRobotDataset("local/test", root=datasets[view], video_backend="pyav")
    assert (len(dataset), dataset.num_episodes, dataset.fps) == (2 * rows, 2, 20)
    assert dataset.meta.robot_type == schema.ROBOT_TYPE
    episode, reader = make_episode(1), ImageReader(datasets[view])
    decoded = {key: [*reader.images(1, key)] for key in reader.shapes}
    assert {*map(len, decoded.values())} == {rows}
    for position, row in enumerate(rows_of_view(episode, view, (0.5,))):
        item = dataset[rows + position]
        assert isinstance(item, dict)
        assert item["task"] == "lift the ball"
        for key, value in row_columns(episode, row, view).items():
            assert np.array_equal(np.atleast_1d(item[key]), np.atleast_1d(value)), (row, key)
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


@pytest.mark.parametrize("view", schema.VIEWS)
def test_what_breaks_off_is_no_dataset(tmp_path, make_episode, view: schema.View) -> None:
    root = tmp_path / view
    with pytest.raises(KeyboardInterrupt), ViewWriter(root, "local/x", view, CAMERAS, *SIZE) as writer:  # noqa: PT012
        write_episode(make_episode(0), [writer])
        writer.add_row(make_episode(1), 0, make_episode(1).images(0))
        raise KeyboardInterrupt
    with pytest.raises(DatasetError, match="no episodes"):
        RecordedDataset(root)
