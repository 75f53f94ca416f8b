"""Draw docs/frames.svg: frames, cameras, workspace and hands, from the numbers of the scene.

Usage: frames_figure.py
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from svg import arrow, dot, line, svg, text

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M, VOXEL_WORKSPACE
from lerobot_env_bimanual.world.cameras import calibration
from lerobot_env_bimanual.world.scene import Scene

OUTPUT = Path(__file__).parents[1] / "docs/frames.svg"
PIXELS_PER_M = 200
X, Y, Z = 0, 1, 2
AXIS_COLORS = ("#c62622", "#16803c", "#0055b3")
ARM_COLORS = {"left": "#0072b2", "right": "#d55e00"}
CAMERA_COLOR, BOX_COLOR, TABLE_COLOR = "#7a3e9d", "#8a8d95", "#c9b79c"
FRUSTUM_M, AXIS_M = 0.28, 0.16


class View:
    """The scene from one side, true to scale.

    Args:
        title: above it.
        across: world axis that points to the right.
        upward: world axis that points up.
        corner: pixels of the upper left corner.
        lower: smallest world coordinate shown, across and upward.
        upper: largest one.
    """

    def __init__(
        self, title: str, across: int, upward: int, corner: ArrayLike, lower: ArrayLike, upper: ArrayLike
    ):
        self.axes = [across, upward]
        self.corner, self.lower, self.upper = map(np.asarray, (corner, lower, upper))
        self.parts = [text(np.add(self.corner, (0, -10)), title, "title")]

    def at(self, point_m: ArrayLike) -> np.ndarray:
        """Pixels of a world point (3,)."""
        across, upward = np.asarray(point_m, float)[self.axes]
        offset = np.array([across - self.lower[0], self.upper[1] - upward])
        return self.corner + PIXELS_PER_M * offset

    def outline(
        self, lower_m: ArrayLike, upper_m: ArrayLike, color: str, dash: str = "", fill: str = "none"
    ) -> None:
        """The box between two corners (3,)."""
        (left, bottom), (right, top) = self.at(lower_m), self.at(upper_m)
        ring = [(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)]
        self.parts.append(line(ring, color, dash=dash, fill=fill))

    def frame(self, world_T_frame: np.ndarray, length_m: float = AXIS_M) -> None:
        """The axes of a frame (4, 4): x red, y green, z blue; one that points at the reader is a dot."""
        origin_m = world_T_frame[:3, 3]
        for axis, color in enumerate(AXIS_COLORS):
            end_m = origin_m + length_m * world_T_frame[:3, axis]
            start, end = self.at(origin_m), self.at(end_m)
            short = np.linalg.norm(end - start) < 6
            self.parts.append(dot(start, color, 3) if short else arrow(start, end, color))

    def camera(self, name: str, world_T_camera: np.ndarray, intrinsics: np.ndarray) -> None:
        """What a camera sees, up to a short distance."""
        half = intrinsics[0, 2] / intrinsics[0, 0] * FRUSTUM_M
        corners = [
            (x, y, FRUSTUM_M, 1) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))
        ]
        eye = self.at(world_T_camera[:3, 3])
        ends = [self.at((world_T_camera @ corner)[:3]) for corner in corners]
        self.parts += [line([eye, end], CAMERA_COLOR, 1) for end in ends]
        self.parts += [line([*ends, ends[0]], CAMERA_COLOR, 1.5), dot(eye, CAMERA_COLOR)]
        side, anchor = (-1, "end") if name.startswith("right") else (1, "start")
        self.parts.append(text(np.add(eye, (8 * side, -8)), name, "small", anchor))


def draw() -> str:
    """The drawing."""
    scene = Scene([])
    calibrations = [matrices.reshape(len(CAMERA_NAMES), -1) for matrices in calibration(scene, 256, 256)]
    views = [
        View("from above", X, Y, (30, 50), (-1.0, -1.5), (1.8, 0.9)),
        View("from the near side", X, Z, (620, 50), (-1.0, 0.0), (1.8, 2.4)),
    ]
    table = scene.model.geom("table")
    for view in views:
        view.outline(table.pos - table.size, table.pos + table.size, "#9a8562", fill=TABLE_COLOR)
        view.outline(VOXEL_WORKSPACE.lower, VOXEL_WORKSPACE.upper, BOX_COLOR, dash="6 4")
        for arm in ARMS:
            base_m = scene.data.body(scene.arm_pair.base_body(arm)).xpos
            tcp = scene.tcp(arm)
            color = ARM_COLORS[arm]
            view.parts += [
                line([view.at(base_m), view.at(tcp.position)], color, 1, "3 3"),
                dot(view.at(base_m), color, 9),
                text(np.add(view.at(base_m), (0, 26)), f"{arm} base", "small", "middle"),
            ]
            view.frame(tcp.matrix)
        for name, extrinsics, intrinsics in zip(CAMERA_NAMES, *calibrations, strict=True):
            view.camera(name, extrinsics.reshape(4, 4), intrinsics.reshape(3, 3))
        view.frame(np.eye(4), 0.3)
        view.parts.append(text(np.add(view.at((0, 0, 0)), (6, 16)), "world", "small"))
    lower, upper = VOXEL_WORKSPACE.lower, VOXEL_WORKSPACE.upper
    notes = [
        "Axes: x red, y green, z blue. A hand's frame lies between its fingertips: z leaves the palm, y is the way the "
        "fingers open.",
        f"Dashed grey: the cubic metre that voxel policies see, {lower} to {upper} m. The table's top is at z = "
        f"{TABLE_HEIGHT_M} m.",
        "Violet: cameras with what they see of the first 28 cm; their frames have z forward, x right and y down in the "
        "image (OpenCV).",
    ]
    parts = [part for view in views for part in view.parts]
    parts += [text((30, 580 + 22 * index), note) for index, note in enumerate(notes)]
    return svg(
        1200, 640, parts, "Frames, cameras, workspace and hands at home, from above and from the near side"
    )


if __name__ == "__main__":
    OUTPUT.write_text(draw(), encoding="utf-8")
