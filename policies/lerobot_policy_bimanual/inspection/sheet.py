"""Draw what a policy saw in one sample, what it predicted, and the label: three views with heat maps and hands."""

import math
from typing import Any

import numpy as np
import torch
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.dataset.schema import ACTION, KEYPOSE_STEP
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_policy_bimanual.keypose.losses import distances
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

MAX_SCENE_VOXELS = 100
"""Largest number of voxels per axis that the scene is shown with."""

MAX_HOT_VOXELS = 300
"""Largest number of voxels of an arm's heat map that are shown."""

MIN_HEAT_SHARE = 0.02
"""Voxels with less than this share of the highest probability are not shown."""

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


def draw_sheet(policy: KeyposePolicy, batch: dict[str, Any], origin: str) -> Figure:
    """Run a policy on the first sample of a preprocessed batch with label, and draw three views side by side.

    Nothing hides the heat maps and the hands; a voxel is the more opaque the more probable it is. The subtitle tells the
    `origin`: the policy and the sample.

    Raises:
        BadObservation: the batch cannot be true.
    """
    observation, prediction, chosen = policy.infer(batch)
    label = batch[ACTION]
    workspace, voxels = policy.config.workspace, min(policy.config.voxel_size, MAX_SCENE_VOXELS)
    grid = voxelise(observation.points[:1], observation.colours[:1], workspace=workspace, voxels=voxels)[0]
    occupied = grid[9].nonzero().cpu()
    scene_m = workspace.lower + (occupied.numpy() + 0.5) * workspace.size / voxels
    rgb = (grid[3:6].cpu()[:, *occupied.unbind(1)].T.numpy().clip(-1, 1) + 1) / 2
    hot = [hot_voxels(volume.float(), policy.codec) for volume in prediction.translation.probabilities()[0]]
    predicted, true = (BimanualKeypose.from_vector(vectors[0].cpu()) for vectors in (chosen, label))
    distance_m, angle_rad = (errors[0].tolist() for errors in distances(chosen[:1], label[:1].float()))

    figure = Figure(figsize=(19, 8), layout="constrained")
    step = int(batch[KEYPOSE_STEP].flatten()[0])
    figure.suptitle(f"“{observation.instructions[0]}”\n{origin}, keypose step {step}")
    for number, (title, (azimuth_deg, elevation_deg)) in enumerate(VIEW_DIRECTIONS.items(), start=1):
        axes: Any = figure.add_subplot(
            1, len(VIEW_DIRECTIONS), number, projection="3d", proj_type="ortho", computed_zorder=False
        )
        axes.view_init(elev=elevation_deg, azim=azimuth_deg)
        axes.scatter(*scene_m.T, c=1 - SCENE_SHARE * (1 - rgb), marker="s", s=16, depthshade=False)
        for arm, (hot_m, heat) in zip(ARMS, hot, strict=True):
            colors = np.tile(to_rgba(ARM_COLORS[arm]), (len(heat), 1))
            # The square root shows second-best voxels, too.
            colors[:, 3] = MIN_OPACITY + (MAX_OPACITY - MIN_OPACITY) * np.sqrt(heat / heat[-1])
            axes.scatter(*hot_m.T, c=colors, marker="s", s=16, depthshade=False)
        for arm in ARMS:
            # The true hand is wider, so that it shows on both sides of a prediction that is right.
            _draw_hand(axes, true[arm], INK, width=6)
            _draw_hand(axes, predicted[arm], ARM_COLORS[arm], width=3)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_title(title)
    labels = {
        f"{arm} arm: {100 * distance_m[arm.ordinal]:.1f} cm and {math.degrees(angle_rad[arm.ordinal]):.0f}° off, "
        f"best voxel {heat[-1]:.1%}": ARM_COLORS[arm]
        for arm, (_, heat) in zip(ARMS, hot, strict=True)
    }
    axes_of_hand = zip(("hand x", "hand y (fingers)", "hand z"), AXIS_COLORS, strict=True)
    labels |= {"true hand": INK} | dict(axes_of_hand)
    handles = [Line2D([], [], color=color, label=text, linewidth=4) for text, color in labels.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def hot_voxels(
    volume: torch.Tensor, codec: TorchKeyposeCodec
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (n, 3) in the world and probabilities (n,) of the most probable of voxels (v, v, v), the most probable last."""
    heat, flat = volume.flatten().topk(min(MAX_HOT_VOXELS, volume.numel()))
    kept = heat >= MIN_HEAT_SHARE * heat[0]
    voxel = torch.stack(torch.unravel_index(flat[kept].flip(0), volume.shape), dim=1)
    return codec.voxel_centers(voxel).double().cpu().numpy(), heat[kept].flip(0).double().cpu().numpy()


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
