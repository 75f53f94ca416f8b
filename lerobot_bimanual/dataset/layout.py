"""Whether a dataset has the columns of the schema, and of which types they are."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.provenance import check_version
from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.errors import DatasetError

type Features = dict[str, dict[str, Any]]
"""LeRobot's table of the features of a dataset."""


def view_of(features: Features) -> View:
    """Which view a dataset is, by its actions."""
    names = features.get(schema.ACTION, {}).get("names")
    return "keyframes" if names == [*feature_table.ACTIONS["keyframes"]] else "frames"


def column_types(features: Features) -> dict[str, pa.DataType]:
    """Arrow type of every column of the schema that is no image; LeRobot stores a vector of one number as a scalar."""
    plans = {key: kind for key, kind in feature_table.PLANS.items() if key in features}
    scalars = feature_table.SCALARS | plans
    types = {key: pa.type_for_alias(dtype) for key, dtype in scalars.items()}
    for key in (key for key in (*schema.VECTORS, schema.WRIST_EXTRINSICS, schema.ACTION) if key in features):
        (size,) = features[key]["shape"]
        types[key] = pa.float32() if size == 1 else pa.list_(pa.float32(), size)
    return types


def check_features(features: Features, root: Path) -> None:
    """Refuse a dataset of another schema version, with other vectors or scalars, or with a damaged calibration."""
    check_version(features, root)
    try:
        calibration = Calibration.of_features(features)
    except DatasetError as error:
        raise DatasetError(f"{root}: {error}") from None
    ours = feature_table.features((), 0, 0, view_of(features), calibration=calibration)
    expected = json.loads(json.dumps(ours))
    differences = [f"{key} is missing" for key in expected if key not in features]
    for key in (key for key in expected if key in features):
        for aspect in ("dtype", "shape", "names"):
            ours, theirs = expected[key][aspect], features[key].get(aspect)
            if ours != theirs:
                differences.append(f"{aspect} of {key} is {theirs}, not {ours}")
    for key, feature in features.items():
        if (unit := (feature.get("info") or {}).get("depth_unit", "mm")) != "mm":
            differences.append(f"depth_unit of {key} is {unit!r}, not 'mm'")
    if differences:
        raise DatasetError(
            f"{root} is not a dataset that this version of lerobot_bimanual reads: {'; '.join(differences)}. "
            "Generate it again, or install the version that wrote it."
        )
