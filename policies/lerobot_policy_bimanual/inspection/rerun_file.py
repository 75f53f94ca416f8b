"""The same inspection in space, as a file for the viewer rerun (https://rerun.io)."""

import importlib.util
from pathlib import Path

import numpy as np

from lerobot_bimanual.errors import BimanualError
from lerobot_policy_bimanual.inspection.inspection import Inspection
from lerobot_policy_bimanual.inspection.scene_picture import ARM_COLORS, AXIS_COLORS, AXIS_M


def require_rerun() -> None:
    """Check that rerun is there before any work is done.

    Raises:
        BimanualError: it is not.
    """
    if importlib.util.find_spec("rerun") is None:
        raise BimanualError(
            "--rerun needs the package rerun-sdk, LeRobot's extra `viz`: pip install 'lerobot[viz]', or leave "
            "--rerun out for the picture alone"
        )


def write_rerun(inspection: Inspection, path: Path) -> None:
    """Write the scene as points, heat maps as boxes and hands as transforms; open it with `rerun FILE`."""
    import rerun as rr  # pyright: ignore[reportMissingImports]

    stream = rr.RecordingStream("lerobot_bimanual")
    stream.save(path)
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("instruction", rr.TextDocument(inspection.instruction), static=True)
    scene = inspection.scene
    points = rr.Points3D(scene.center_m, colors=inspection.rgb, radii=float(scene.size_m.min()) / 2)
    stream.log("scene", points, static=True)
    for arm in inspection.arms:
        opacity = np.sqrt(arm.heat / arm.heat[-1])
        colors = np.column_stack([np.tile(ARM_COLORS[arm.arm], (len(opacity), 1)), 255 * opacity])
        boxes = rr.Boxes3D(
            centers=arm.hot.center_m,
            half_sizes=np.tile(arm.hot.size_m / 2, (len(opacity), 1)),
            colors=colors.astype(np.uint8),
            labels=[f"{100 * heat:.2g} %" for heat in arm.heat],
            show_labels=False,
        )
        stream.log(f"{arm.arm}/heat", boxes, static=True)
        for name, keypose in (("predicted", arm.predicted), ("true", arm.true)):
            place = f"{arm.arm}/{name}"
            pose = rr.Transform3D(translation=keypose.pose.position, mat3x3=keypose.pose.rotation)
            stream.log(place, pose, static=True)
            axes = rr.Arrows3D(vectors=AXIS_M * np.eye(3), colors=AXIS_COLORS, radii=AXIS_M / 20)
            stream.log(f"{place}/axes", axes, static=True)
            tip = rr.Points3D([[0, 0, 0]], colors=[ARM_COLORS[arm.arm]], radii=AXIS_M / 8, labels=[place])
            stream.log(f"{place}/tip", tip, static=True)
    stream.disconnect()
