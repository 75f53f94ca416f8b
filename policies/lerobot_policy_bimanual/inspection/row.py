"""Whether a dataset has a row, by its own description; asked before anything heavy is imported."""

from pathlib import Path

from lerobot_bimanual.dataset.reader import read_info
from lerobot_bimanual.errors import DatasetError


def require_row(root: Path, index: int) -> None:
    """Check that a dataset has a row.

    Args:
        root: folder of the dataset.
        index: row, counted over all episodes.

    Raises:
        DatasetError: it has not, or does not say how many it has.
    """
    rows = read_info(root).get("total_frames")
    if type(rows) is not int or rows < 1:
        raise DatasetError(
            f"{root} does not say how many rows it has: restore meta/info.json, or generate it again"
        )
    if not 0 <= index < rows:
        raise DatasetError(f"{root} has rows 0 to {rows - 1}, but not {index}")
