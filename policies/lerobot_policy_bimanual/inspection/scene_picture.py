"""Draws one view of an inspection: voxels, heat maps, hands."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.keypose import Keypose
from lerobot_policy_bimanual.inspection.inspection import Inspection, Voxels
from lerobot_policy_bimanual.inspection.projection import Frame, ViewDirection

PAPER = (255, 255, 255)
INK = (32, 34, 40)
ARM_COLORS = {Arm.LEFT: (18, 96, 214), Arm.RIGHT: (226, 84, 0)}
"""Blue and orange: also those who do not tell red from green can tell them apart."""

AXIS_COLORS = ((214, 40, 40), (30, 150, 60), (90, 60, 220))
"""x, y and z axis of a hand."""

OVERSAMPLING = 2
"""Pictures are drawn at this multiple of their size and shrunk, which smooths edges."""

PALING = 0.35
"""How far the scene is moved towards white, so that the predictions stand out."""

FACE_LIGHT = (0.72, 0.86, 1.0)
"""Brightness of faces whose normal is along x, y or z."""

FAINTEST, STRONGEST = 40, 225
"""Opacity of the coldest and the hottest voxel, of 255."""

FINGER_M, STEM_M, AXIS_M = 0.06, 0.06, 0.07
"""Lengths in the drawing of a hand."""

OPEN_M, CLOSED_M = 0.04, 0.01
"""Half the distance of the fingers in the drawing of a hand."""


def draw_scene(inspection: Inspection, direction: ViewDirection, width: int, height: int) -> Image.Image:
    """One view of an inspection.

    Nothing hides the heat maps and the hands. A voxel is the more opaque the more probable it is; predicted hands
    have the arm's colour, true ones are dark.
    """
    size = (OVERSAMPLING * width, OVERSAMPLING * height)
    hands = [keypose.pose.position for arm in inspection.arms for keypose in (arm.predicted, arm.true)]
    frame = Frame.fit(direction, [*inspection.scene.center_m, *hands], *size)
    picture = Image.new("RGB", size, PAPER)
    _draw_scene(ImageDraw.Draw(picture), frame, inspection.scene, inspection.rgb)
    for arm in inspection.arms:
        picture.paste(ARM_COLORS[arm.arm], mask=_heat_mask(size, frame, arm.hot, arm.heat))
    draw = ImageDraw.Draw(picture)
    for arm in inspection.arms:
        # The true one is broad, so that it shows on both sides of a prediction that is right.
        _draw_hand(draw, frame, arm.true, INK, width=6)
        _draw_hand(draw, frame, arm.predicted, ARM_COLORS[arm.arm], width=3)
    return picture.resize((width, height), Image.Resampling.LANCZOS)


def _draw_scene(draw: ImageDraw.ImageDraw, frame: Frame, voxels: Voxels, rgb: NDArray[np.uint8]) -> None:
    pale = rgb + PALING * (255 - rgb.astype(float))
    # Cubes on a lattice, seen in parallel projection, hide each other in the order of their centres.
    order = np.argsort(frame.nearness(voxels.center_m))
    occupied = {tuple(index) for index in voxels.index.tolist()}
    faces = list(_faces(frame, voxels))
    for cube in order.tolist():
        place = voxels.index[cube]
        for axis, side, corners in faces:
            neighbour = place.copy()
            neighbour[axis] += side
            if tuple(neighbour.tolist()) not in occupied:
                color = tuple((FACE_LIGHT[axis] * pale[cube]).astype(int).tolist())
                draw.polygon(corners[cube].ravel().tolist(), fill=color)


def _heat_mask(size: tuple[int, int], frame: Frame, hot: Voxels, heat: NDArray[np.float64]) -> Image.Image:
    """Opacity of an arm's colour: at every pixel that of the hottest voxel behind it."""
    mask = Image.new("L", size, 0)
    draw = ImageDraw.Draw(mask)
    # The square root shows second-best places too.
    opacity = FAINTEST + (STRONGEST - FAINTEST) * np.sqrt(heat / heat[-1])
    faces = list(_faces(frame, hot))
    for cube, alpha in enumerate(opacity.astype(int).tolist()):
        for _, _, corners in faces:
            draw.polygon(corners[cube].ravel().tolist(), fill=alpha)
    return mask


def _faces(frame: Frame, voxels: Voxels) -> Iterator[tuple[int, int, NDArray[np.float64]]]:
    """The faces of cubes that are turned to the viewer.

    Yields:
        Axis and sign of the normal, and the corners (n, 4, 2) in pixels of that face of every cube.
    """
    for axis, towards in enumerate(frame.direction.axes[2]):
        if abs(towards) < 1e-6:
            continue
        side = 1 if towards > 0 else -1
        corners = np.zeros((4, 3))
        corners[:, axis] = side
        corners[:, (axis + 1) % 3] = (-1, 1, 1, -1)
        corners[:, (axis + 2) % 3] = (-1, -1, 1, 1)
        yield axis, side, frame.project(voxels.center_m[:, None] + corners * voxels.size_m / 2)


def _draw_hand(
    draw: ImageDraw.ImageDraw, frame: Frame, hand: Keypose, color: tuple[int, int, int], width: int
) -> None:
    """A fork whose tips are the fingertips, as far apart as the gripper is open, and the three axes."""
    half = OPEN_M if hand.gripper_open else CLOSED_M
    palm, wrist = -FINGER_M, -FINGER_M - STEM_M
    fingers = [(0, -half, 0), (0, -half, palm), (0, half, palm), (0, half, 0)]
    fork = [_to_pixels(frame, hand.pose, line) for line in (fingers, [(0, 0, palm), (0, 0, wrist)])]
    for stroke, fill in ((width + 2, PAPER), (width, color)):
        for line in fork:
            draw.line(line, fill=fill, width=OVERSAMPLING * stroke, joint="curve")
    for axis, axis_color in zip(np.eye(3), AXIS_COLORS, strict=True):
        line = _to_pixels(frame, hand.pose, [np.zeros(3), AXIS_M * axis])
        draw.line(line, fill=axis_color, width=OVERSAMPLING * 2)
    radius = OVERSAMPLING * width
    column, row = frame.project(hand.pose.position).tolist()
    draw.ellipse((column - radius, row - radius, column + radius, row + radius), fill=color, outline=PAPER)


def _to_pixels(frame: Frame, pose: Pose, points: Sequence) -> list[tuple[float, float]]:
    world = pose.position + np.asarray(points, dtype=float) @ pose.rotation.T
    return [(column, row) for column, row in frame.project(world).tolist()]
