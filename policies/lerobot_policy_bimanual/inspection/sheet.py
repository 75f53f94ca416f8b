"""Draw an inspection: three views of the scene with heat maps and hands, and a line of numbers per arm."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.keypose import Keypose
from lerobot_policy_bimanual.inspection.inspection import ArmInspection, Inspection, Voxels

Array = NDArray[np.float64]

INK = "#202228"
ARM_COLORS = {Arm.LEFT: "#1260d6", Arm.RIGHT: "#e25400"}
"""Blue and orange, which red-green colour-blind readers can tell apart."""

AXIS_COLORS = ("#d62828", "#1e963c", "#5a3cdc")
"""x, y and z axis of a hand."""

SCENE_SHARE = 0.65
"""Share of their colour that voxels of the scene keep, the rest being white, so that predictions stand out."""

FACE_LIGHT = (0.72, 0.86, 1.0)
"""Brightness of faces whose normal is along x, y or z."""

MIN_OPACITY, MAX_OPACITY = 0.15, 0.88
"""Opacity of the coldest and the hottest voxel."""

FINGER_M, STEM_M, AXIS_M = 0.06, 0.06, 0.07
"""Lengths in the drawing of a hand."""

OPEN_M, CLOSED_M = 0.04, 0.01
"""Half the distance of the fingers in the drawing of a hand."""


@dataclass(frozen=True)
class ViewDirection:
    """A parallel projection. The arms face each other: the left one is at low x, the right one at high x.

    Attributes:
        name: title of the view.
        azimuth_deg: bearing of the viewer as seen from the workspace, from +x towards +y.
        elevation_deg: height of the viewer, 90 for straight above.
    """

    name: str
    azimuth_deg: float
    elevation_deg: float

    @property
    def axes(self) -> Array:
        """World directions (3, 3), by row: right and up in the picture, and towards the viewer."""
        azimuth, elevation = np.deg2rad([self.azimuth_deg, self.elevation_deg])
        level = np.cos(elevation)
        towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        return np.stack([right, np.cross(towards, right), towards])

    def project(self, points_m: ArrayLike) -> Array:
        """Coordinates (..., 2) in metres, right and up in the picture, of world points (..., 3)."""
        return np.asarray(points_m) @ self.axes[:2].T


VIEW_DIRECTIONS = (
    ViewDirection("over the left arm's shoulder", 205, 35),
    ViewDirection("over the right arm's shoulder", 25, 20),
    ViewDirection("from above, the left arm at the bottom, the right one at the top", 180, 90),
)


def draw_sheet(inspection: Inspection, origin: str) -> Figure:
    """Draw three views side by side, with the errors and probabilities of both arms.

    Args:
        inspection: what to draw.
        origin: the policy and the sample, for the subtitle.
    """
    figure = Figure(figsize=(19, 8), layout="constrained")
    figure.suptitle(f"“{inspection.instruction}”\n{origin}, keypose step {inspection.keypose_step}")
    for axes, direction in zip(figure.subplots(1, len(VIEW_DIRECTIONS)), VIEW_DIRECTIONS, strict=True):
        draw_scene(axes, inspection, direction)
    labels = {_describe(arm): ARM_COLORS[arm.arm] for arm in inspection.arms}
    labels |= {"true hand": INK} | dict(
        zip(("hand x", "hand y (fingers)", "hand z"), AXIS_COLORS, strict=True)
    )
    handles = [Line2D([], [], color=color, label=label, linewidth=4) for label, color in labels.items()]
    figure.legend(handles=handles[:2], loc="outside lower left", frameon=False)
    figure.legend(handles=handles[2:], loc="outside lower right", ncols=2, frameon=False)
    return figure


def draw_scene(axes: Axes, inspection: Inspection, direction: ViewDirection) -> None:
    """Draw one view. Nothing hides the heat maps and the hands; a voxel is the more opaque the more probable it is."""
    scene = inspection.scene
    pale = 1 - SCENE_SHARE * (1 - inspection.rgb / 255)
    axes.add_collection(_cubes(direction, scene, pale, np.argsort(scene.center_m @ direction.axes[2])))
    for arm in inspection.arms:
        # The square root shows second-best voxels, too.
        opacity = MIN_OPACITY + (MAX_OPACITY - MIN_OPACITY) * np.sqrt(arm.heat / arm.heat[-1])
        heat = _cubes(direction, arm.hot, np.ones((len(arm.heat), 3)), np.arange(len(arm.heat)), cull=False)
        heat.set(
            facecolor=ARM_COLORS[arm.arm], alpha=np.repeat(opacity, len(heat.get_paths()) // len(opacity))
        )
        axes.add_collection(heat)
    for arm in inspection.arms:
        # The true hand is wider, so that it shows on both sides of a prediction that is right.
        _draw_hand(axes, direction, arm.true, INK, width=6)
        _draw_hand(axes, direction, arm.predicted, ARM_COLORS[arm.arm], width=3)
    axes.set(title=direction.name, aspect="equal")
    axes.autoscale()
    axes.axis("off")


def _cubes(
    direction: ViewDirection, voxels: Voxels, rgb: Array, order: NDArray[np.int64], *, cull: bool = True
) -> PolyCollection:
    """The faces of cubes that are turned to the viewer, cube by cube in an order, without those inside if they are culled."""
    occupied = set(map(tuple, voxels.index.tolist())) if cull else set()
    faces = list(_faces(direction, voxels))
    corners, colors = [], []
    for cube in order.tolist():
        for axis, step, face in faces:
            if tuple((voxels.index[cube] + step).tolist()) not in occupied:
                corners.append(face[cube])
                colors.append(FACE_LIGHT[axis] * rgb[cube])
    return PolyCollection(corners, facecolors=colors, edgecolors="none")


def _faces(direction: ViewDirection, voxels: Voxels) -> Iterator[tuple[int, NDArray[np.int64], Array]]:
    """For each axis: the step to the neighbour behind the face that the viewer sees, and its corners (n, 4, 2)."""
    for axis, towards in enumerate(direction.axes[2]):
        if abs(towards) < 1e-6:
            continue
        step = np.zeros(3, dtype=np.int64)
        step[axis] = np.sign(towards)
        corners = np.tile(step.astype(float), (4, 1))
        corners[:, (axis + 1) % 3] = (-1, 1, 1, -1)
        corners[:, (axis + 2) % 3] = (-1, -1, 1, 1)
        yield axis, step, direction.project(voxels.center_m[:, None] + corners * voxels.size_m / 2)


def _draw_hand(axes: Axes, direction: ViewDirection, hand: Keypose, color: str, width: int) -> None:
    """Draw a fork whose tips are the fingertips, as far apart as the gripper is open, and the three axes."""

    def line(points: Sequence, **style: object) -> None:
        world = hand.pose.position + np.asarray(points, dtype=float) @ hand.pose.rotation.T
        axes.plot(*direction.project(world).T, **style)

    half = OPEN_M if hand.gripper_open else CLOSED_M
    for linewidth, fill in ((width + 2, "white"), (width, color)):
        style = {"color": fill, "linewidth": linewidth}
        line([(0, -half, 0), (0, -half, -FINGER_M), (0, half, -FINGER_M), (0, half, 0)], **style)
        line([(0, 0, -FINGER_M), (0, 0, -FINGER_M - STEM_M)], **style)
    for axis, axis_color in zip(np.eye(3), AXIS_COLORS, strict=True):
        line([np.zeros(3), AXIS_M * axis], color=axis_color, linewidth=2)
    line([np.zeros(3)], color=color, marker="o", markersize=2 * width, markeredgecolor="white")


def _describe(arm: ArmInspection) -> str:
    def verdict(right: bool, probability: float) -> str:
        return f"{'right' if right else 'wrong'} ({probability:.0%})"

    predicted, true = arm.predicted, arm.true
    angles = " / ".join(f"{probability:.0%}" for probability in arm.rotation_probabilities)
    return (
        f"{arm.arm} arm: {arm.position_error_cm:.1f} cm off, best voxel {arm.heat[-1]:.1%}, true voxel "
        f"{arm.true_voxel_probability:.1%}; {arm.rotation_error_deg:.0f}° off, angles x / y / z {angles}; gripper "
        f"{verdict(predicted.gripper_open == true.gripper_open, arm.gripper_probability)}, collision flag "
        f"{verdict(predicted.ignore_collisions == true.ignore_collisions, arm.collision_probability)}"
    )
