"""Dataset card, `README.md`: what is needed to use a dataset and to make it again."""

import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pandas as pd

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.reader import IMAGE_TYPES, is_depth, read_info
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import write_file
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_NAMES
from lerobot_bimanual.pages import render

CARD_FILE = Path("README.md")

LICENSE = "apache-2.0"
TAGS = ("LeRobot", "bimanual", "mujoco", "simulation", "rgbd", "depth", "keyframe", "keypose")

MEANINGS = tomllib.loads((Path(__file__).parent / "templates/columns.toml").read_text(encoding="utf-8"))
"""Each column in words; that of an action by view."""


def write_card(root: Path, repo_id: str) -> None:
    """Write the card of a dataset, which LeRobot calls `repo_id`, from its metadata and provenance.

    Raises:
        DatasetError: the dataset has no provenance.
        UnwritableOutput: its folder cannot be written.
    """
    provenance = Provenance.of_dataset(root)
    if provenance is None:
        raise DatasetError(f"{root} has no provenance, so there is nothing to write a card from")
    info, fractions = read_info(root), provenance.settings.get("intermediate")
    keys = pd.DataFrame({"task": key.task, "variation": key.variation} for key in provenance.episodes)
    text = render(
        "lerobot_bimanual.dataset",
        "card.md",
        tags=TAGS,
        repo_id=repo_id,
        info=info,
        provenance=provenance,
        intermediate=fractions if isinstance(fractions, list | tuple) else (),  # of any file that was found
        episodes=keys.value_counts(sort=False).reset_index(name="episodes"),
        columns=_columns(info, provenance.view),
        depth=any(map(is_depth, info["features"].values())),
        schema=schema,
        keypose_names=ARM_KEYPOSE_NAMES,
        cameras=CAMERA_NAMES,
        calibrated=Calibration.of_features(info["features"]) is not None,
        versions=[f"{package} {version}" for package, version in provenance.versions.items()],
        seeds=[key.seed for key in provenance.episodes],
        license=LICENSE,
        links=[url.split(", ", 1) for url in metadata("lerobot_bimanual").get_all("Project-URL") or ()],
    )
    write_file(root / CARD_FILE, text)


def _columns(info: dict, view: schema.View) -> pd.DataFrame:
    rows = []
    meanings = MEANINGS | {schema.ACTION: MEANINGS[schema.ACTION][view]}
    for key, feature in info["features"].items():
        meaning = meanings.get(key)
        if meaning is None and feature["dtype"] in IMAGE_TYPES:
            meaning = "depth along the optical axis" if is_depth(feature) else "RGB"
        if meaning is not None:  # the others are LeRobot's own bookkeeping
            shape = " x ".join(map(str, feature["shape"]))
            rows.append({"column": f"`{key}`", "type": feature["dtype"], "shape": shape, "meaning": meaning})
    return pd.DataFrame(rows)
