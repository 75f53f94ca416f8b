"""Draw an inspection: three views of the scene with heat maps and hands, and a line of numbers per arm."""

from typing import Any

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.keypose import Keypose
from lerobot_policy_bimanual.inspection.inspection import Inspection

INK = "#202228"
ARM_COLORS = {Arm.LEFT: "#1260d6", Arm.RIGHT: "#e25400"}
"""Blue and orange, which red-green colour-blind readers can tell apart."""

AXIS_COLORS = ("#d62828", "#1e963c", "#5a3cdc")
"""x, y and z axis of a hand."""

SCENE_SHARE = 0.65
"""Share of their colour that voxels of the scene keep, the rest being white, so that predictions stand out."""

MIN_OPACITY, MAX_OPACITY = 0.15, 0.88
"""Opacity of the coldest and the hottest voxel."""

FINGER_M, STEM_M, AXIS_M = 0.06, 0.06, 0.07
"""Lengths in the drawing of a hand."""

OPEN_M, CLOSED_M = 0.04, 0.01
"""Half the distance of the fingers in the drawing of a hand."""

VIEW_DIRECTIONS = {
    "over the left arm's shoulder": (205, 35),
    "over the right arm's shoulder": (25, 20),
    "from above, the left arm at the bottom, the right one at the top": (180, 90),
}
"""Bearing of the viewer as seen from the workspace, from +x towards +y, and height, in degrees, by title.

The arms face each other: the left one is at low x, the right one at high x."""


def draw_sheet(inspection: Inspection, origin: str) -> Figure:
    """Draw three views side by side, with the errors and probabilities of both arms.

    Args:
        inspection: what to draw.
        origin: the policy and the sample, for the subtitle.
    """
    figure = Figure(figsize=(19, 8), layout="constrained")
    figure.suptitle(f"“{inspection.instruction}”\n{origin}, keypose step {inspection.keypose_step}")
    for number, (title, (azimuth_deg, elevation_deg)) in enumerate(VIEW_DIRECTIONS.items(), start=1):
        axes: Any = figure.add_subplot(
            1, len(VIEW_DIRECTIONS), number, projection="3d", proj_type="ortho", computed_zorder=False
        )
        axes.view_init(elev=elevation_deg, azim=azimuth_deg)
        draw_scene(axes, inspection)
        axes.set_title(title)
    labels = {arm.numbers: ARM_COLORS[arm.arm] for arm in inspection.arms}
    labels |= {"true hand": INK} | dict(
        zip(("hand x", "hand y (fingers)", "hand z"), AXIS_COLORS, strict=True)
    )
    handles = [Line2D([], [], color=color, label=label, linewidth=4) for label, color in labels.items()]
    figure.legend(handles=handles[:2], loc="outside lower left", frameon=False)
    figure.legend(handles=handles[2:], loc="outside lower right", ncols=2, frameon=False)
    return figure


def draw_scene(axes: Any, inspection: Inspection) -> None:
    """Draw one view. Nothing hides the heat maps and the hands; a voxel is the more opaque the more probable it is."""
    pale = 1 - SCENE_SHARE * (1 - inspection.rgb / 255)
    axes.scatter(*inspection.scene_m.T, c=pale, marker="s", s=16, depthshade=False)
    for arm in inspection.arms:
        colors = np.tile(to_rgba(ARM_COLORS[arm.arm]), (len(arm.heat), 1))
        # The square root shows second-best voxels, too.
        colors[:, 3] = MIN_OPACITY + (MAX_OPACITY - MIN_OPACITY) * np.sqrt(arm.heat / arm.heat[-1])
        axes.scatter(*arm.hot_m.T, c=colors, marker="s", s=16, depthshade=False)
    for arm in inspection.arms:
        # The true hand is wider, so that it shows on both sides of a prediction that is right.
        _draw_hand(axes, arm.true, INK, width=6)
        _draw_hand(axes, arm.predicted, ARM_COLORS[arm.arm], width=3)
    axes.set_aspect("equal")
    axes.axis("off")


def _draw_hand(axes: Any, hand: Keypose, color: str, width: int) -> None:
    """Draw a fork whose tips are the fingertips, as far apart as the gripper is open, and the three axes."""

    def line(points: Any, **style: Any) -> None:
        axes.plot(*(hand.pose.position + np.asarray(points) @ hand.pose.rotation.T).T, **style)

    half = OPEN_M if hand.gripper_open else CLOSED_M
    for linewidth, fill in ((width + 2, "white"), (width, color)):
        style = {"color": fill, "linewidth": linewidth}
        line([(0, -half, 0), (0, -half, -FINGER_M), (0, half, -FINGER_M), (0, half, 0)], **style)
        line([(0, 0, -FINGER_M), (0, 0, -FINGER_M - STEM_M)], **style)
    for axis, axis_color in zip(np.eye(3), AXIS_COLORS, strict=True):
        line([np.zeros(3), AXIS_M * axis], color=axis_color, linewidth=2)
    line([np.zeros(3)], color=color, marker="o", markersize=2 * width, markeredgecolor="white")
