"""LeRobot's table of the features of a dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.joint_action import CONTROL_HZ

if TYPE_CHECKING:
    from pydantic import BaseModel

FPS: dict[schema.View, int] = {"frames": CONTROL_HZ, "keyframes": 1}
"""Rows per second. Those of `keyframes` have no rate, but LeRobot wants a whole number: with 1 its `timestamp`, the row's
number over the rate, counts rows. `TIME` says when a row was recorded."""


def features(
    cameras: tuple[str, ...],
    height: int,
    width: int,
    view: schema.View,
    depth: bool = True,
    outcome: bool = False,
    calibration: BaseModel | None = None,
) -> dict[str, dict[str, Any]]:
    """LeRobot feature table of one view.

    Args:
        cameras: cameras whose images are stored. Calibration always covers all five.
        height: image height in pixels.
        width: image width in pixels.
        view: "frames" has joint actions and stores images as video, "keyframes" has keyposes and stores images losslessly
            in the table.
        depth: whether each camera has a depth image.
        outcome: whether rows say what became of their episode; demonstrations are all solved.
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
    vectors = schema.VECTORS | {schema.ACTION: schema.ACTIONS[view]}
    if calibration is not None:
        del vectors[schema.CAMERA_EXTRINSICS], vectors[schema.CAMERA_INTRINSICS]
        vectors[schema.WRIST_EXTRINSICS] = schema.WRIST_EXTRINSIC_NAMES
    for key, elements in vectors.items():
        table[key] = {"dtype": "float32", "shape": (len(elements),), "names": list(elements)}
    for key, scalar in (schema.SCALARS | (schema.OUTCOME if outcome else {})).items():
        table[key] = {"dtype": scalar, "shape": (1,), "names": None}
    table[schema.TASK_NAME]["info"] = {schema.VERSION_INFO: schema.SCHEMA_VERSION}
    if calibration is not None:
        table[schema.WRIST_EXTRINSICS]["info"] = {schema.CALIBRATION_INFO: calibration.model_dump()}
    return table
