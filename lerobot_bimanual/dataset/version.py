"""The version of a dataset's schema: others are refused with the command that makes the dataset anew."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, TASK_NAME, VERSION_INFO
from lerobot_bimanual.errors import DatasetError

PROVENANCE_FILE = Path("meta", "bimanual.json")


def check_version(features: Mapping[str, Any], root: Path) -> None:
    """Refuse a dataset of another version of the schema; one that does not say its version is not of ours, or was edited.

    Raises:
        DatasetError: it has another version; the message has the command that makes it anew.
    """
    info = (features.get(TASK_NAME) or {}).get("info") or {}
    found, provenance = info.get(VERSION_INFO, SCHEMA_VERSION), root / PROVENANCE_FILE
    if found != SCHEMA_VERSION:
        how = ["generate", "--task=TASK"]
        if provenance.is_file():
            how = ["regenerate", f"--provenance={provenance}"]
        command = shlex.join(["lerobot-bimanual", "dataset", *how, f"--root={root}_anew"])
        raise DatasetError(
            f"{root} has schema version {found}, but this version of lerobot_bimanual reads {SCHEMA_VERSION}: make the "
            f"dataset anew with `{command}`"
        )
