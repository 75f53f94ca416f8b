"""Writes episodes as LeRobotDataset v3, one dataset per view."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from lerobot.datasets.dataset_metadata import LeRobotDatasetMetadata
from lerobot.datasets.dataset_writer import DatasetWriter
from lerobot.datasets.image_writer import AsyncImageWriter, image_array_to_pil_image, save_kwargs_for_path
from numpy.typing import NDArray

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.dataset.video import EpisodeVideoEncoder, depth_encoder, rgb_encoder
from lerobot_bimanual.dataset.views import row_columns, rows_of_view
from lerobot_bimanual.episode import Demonstration

PNG_LEVEL = 5
"""Of zlib. LeRobot compresses at level 6, which takes 15.6 ms for a view of 256x256 where level 5 takes 8.7, for 5 % more
bytes of the same pixels (measured over two cameras)."""


class ImageFileWriter(AsyncImageWriter):
    """Writes the image files that LeRobot stores in its table, each at once instead of in threads."""

    def __init__(self):
        """Start no queue and no thread: only the interface of the base class is used."""

    def save_image(self, image: Any, fpath: Path, compress_level: int = PNG_LEVEL) -> None:
        """Write RGB uint8 (H, W, 3) as PNG, or depth uint16 (H, W, 1) as TIFF."""
        level = min(compress_level, PNG_LEVEL)
        image_array_to_pil_image(image).save(fpath, **save_kwargs_for_path(fpath, level))

    def wait_until_done(self) -> None:
        """All is written already."""

    def stop(self) -> None:
        """There is nothing to stop."""


class ViewWriter:
    """Writes one view of episodes into a new folder.

    Used as a context manager it finishes the dataset when the block ends well, and only then: without LeRobot's
    final footers a dataset cannot be opened, so a broken one cannot be mistaken for a whole one.

    Args:
        root: folder of the dataset; must not exist.
        repo_id: LeRobot's name of the dataset.
        view: which rows are stored, and how their images.
        intermediate: see `rows_of_view`.
        depth: whether depth images are stored; None for `keyframes` alone, from which keypose policies learn: LeRobot's own
            policies, which learn from `frames`, would take them for colours.

    All others are those of `feature_table.features`.
    """

    def __init__(
        self,
        root: Path,
        repo_id: str,
        view: View,
        cameras: Sequence[str],
        height: int,
        width: int,
        intermediate: Sequence[float] = (),
        depth: bool | None = True,
        further: Mapping[str, str] | None = None,
        calibration: Calibration | None = None,
    ):
        self.root = root
        self.view: View = view
        self.intermediate = intermediate
        self._cameras = tuple(cameras)
        self._depth = view == "keyframes" if depth is None else depth
        self._calibration = calibration
        self._meta = LeRobotDatasetMetadata.create(
            repo_id=repo_id,
            fps=feature_table.FPS[view],
            features=feature_table.features(
                self._cameras, height, width, view, self._depth, further, calibration
            ),
            robot_type=schema.ROBOT_TYPE,
            root=root,
            use_videos=view == "frames",
        )
        self._writer = DatasetWriter(
            meta=self._meta,
            root=root,
            rgb_encoder=rgb_encoder(),
            depth_encoder=depth_encoder(),
            encoder_threads=1,
            batch_encoding_size=1,
            streaming_encoder=EpisodeVideoEncoder() if view == "frames" else None,
        )
        self._writer.image_writer = ImageFileWriter()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Write what makes the folder a dataset, unless the block failed."""
        if kind is None:
            self._writer.finalize()
        else:
            self._writer.cancel_pending_videos()

    def add_row(self, episode: Demonstration, row: int, images: dict[str, NDArray]) -> None:
        """Append a row of the running episode; rows ascend.

        Raises:
            DatasetError: the row has another calibration than all others.
        """
        frame = row_columns(episode, row, self.view)
        frame = frame if self._calibration is None else self._calibration.row_without_calibration(frame)
        for camera in self._cameras:
            rgb, depth = schema.image_key(camera), schema.depth_key(camera)
            frame[rgb] = images[rgb]
            if self._depth:
                frame[depth] = feature_table.stored_depth(images[depth])[0, ..., None]  # (H, W, 1) mm
        self._writer.add_frame(frame | {"task": episode.meta.instruction})

    def end_episode(self) -> None:
        """Store the rows added since the last call as an episode."""
        self._writer.save_episode()


def write_episode(episode: Demonstration, writers: Sequence[ViewWriter]) -> None:
    """Write an episode into several views at once, asking for the images of each row only once."""
    rows_per_writer = [set(rows_of_view(episode, writer.view, writer.intermediate)) for writer in writers]
    for row in range(episode.rows):
        users = [writer for writer, rows in zip(writers, rows_per_writer, strict=True) if row in rows]
        images = episode.images(row) if users else {}
        for writer in users:
            writer.add_row(episode, row, images)
    for writer in writers:
        writer.end_episode()
