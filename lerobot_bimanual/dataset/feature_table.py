"""The columns of a dataset, as LeRobot's feature table, and what they store of a depth image."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.keypose_layout import KEYPOSE_NAMES

FPS: dict[schema.View, int] = {"frames": CONTROL_HZ, "keyframes": 1}
"""Rows per second. Those of `keyframes` have no rate, but LeRobot wants a whole number: with 1 its `timestamp`, the row's
number over the rate, counts rows. `TIME` says when a row was recorded."""

ACTIONS: dict[schema.View, tuple[str, ...]] = {"frames": schema.JOINT_NAMES, "keyframes": KEYPOSE_NAMES}
"""Elements of the float32 column `action`: the joint action of a tick, or the next keypose."""

SCALARS: dict[str, str] = {
    schema.KEYFRAME: "bool",
    schema.TICK: "int64",
    schema.TIME: "float32",
    schema.STATE_HASH: "int64",
    schema.TASK_NAME: "string",
    schema.SPLIT: "string",
    schema.VARIATION: "int64",
    schema.SEED: "int64",
}
"""Columns of shape (1,) and their dtype.

The last four are an episode's key: the environment regenerates the episode from them, bit for bit. They are
columns, and not side files, because columns survive every tool that merges, splits or subsets datasets.
"""

SUCCESS, FAILURE_CLASS = "success", "failure_class"
OUTCOME: dict[str, str] = {SUCCESS: "bool"} | dict.fromkeys(
    (FAILURE_CLASS, "policy", "setting", "perturb"), "string"
)
"""Further columns of shape (1,) of policies' episodes: success, the class of the failure ("" after a success), the policy,
and the setting and perturbations."""
PLAN = "plan"
PLANS: dict[str, str] = {PLAN: "int64"}
"""A further column of shape (1,) of demonstrations with several plans: which one it is. No policy reads it."""


def features(
    cameras: tuple[str, ...],
    height: int,
    width: int,
    view: schema.View,
    depth: bool = True,
    further: Mapping[str, str] | None = None,
    calibration: Calibration | None = None,
) -> dict[str, dict[str, Any]]:
    """LeRobot feature table of one view.

    Args:
        cameras: cameras whose images are stored. Calibration always covers all five.
        height: image height in pixels.
        width: image width in pixels.
        view: "frames" has joint actions and stores images as video, "keyframes" has keyposes and stores images losslessly
            in the table.
        depth: whether each camera has a depth image.
        further: dtypes of further columns of shape (1,): `OUTCOME`, of policies' episodes, or `PLANS`.
        calibration: the `Calibration` of all rows; None where rows hold all of it, as the environment's observations do.
    """
    dtype = "video" if view == "frames" else "image"
    names = ["height", "width", "channels"]
    table: dict[str, dict[str, Any]] = {}
    for camera in cameras:
        table[schema.image_key(camera)] = {"dtype": dtype, "shape": (height, width, 3), "names": names}
        if depth:
            table[schema.depth_key(camera)] = {
                "dtype": dtype,
                "shape": (height, width, 1),
                "names": names,
                "info": {"is_depth_map": True},
            }
    vectors = schema.VECTORS | {schema.ACTION: ACTIONS[view]}
    if calibration is not None:
        del vectors[schema.CAMERA_EXTRINSICS], vectors[schema.CAMERA_INTRINSICS]
        vectors[schema.WRIST_EXTRINSICS] = schema.WRIST_EXTRINSIC_NAMES
    for key, elements in vectors.items():
        table[key] = {"dtype": "float32", "shape": (len(elements),), "names": list(elements)}
    for key, scalar in (SCALARS | dict(further or {})).items():
        table[key] = {"dtype": scalar, "shape": (1,), "names": None}
    table[schema.TASK_NAME]["info"] = {schema.VERSION_INFO: schema.SCHEMA_VERSION}
    if calibration is not None:
        table[schema.WRIST_EXTRINSICS]["info"] = {schema.CALIBRATION_INFO: calibration.model_dump()}
    return table


def stored_depth(depth_mm: NDArray) -> NDArray[np.uint16]:
    """Depth in mm as datasets store it: whole millimetres within the range; its lower end means not measured."""
    return np.rint(np.maximum(depth_mm, schema.DEPTH_MIN_M * schema.MM_PER_M)).astype(np.uint16)
