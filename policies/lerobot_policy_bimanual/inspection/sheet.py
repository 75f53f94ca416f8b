"""The whole picture of an inspection: three views, and what the numbers say."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lerobot_bimanual.geometry.rotations import quat_wxyz_to_euler_xyz
from lerobot_bimanual.keypose import Keypose
from lerobot_policy_bimanual.inspection.inspection import ArmInspection, Inspection
from lerobot_policy_bimanual.inspection.projection import VIEW_DIRECTIONS
from lerobot_policy_bimanual.inspection.scene_picture import ARM_COLORS, AXIS_COLORS, INK, PAPER, draw_scene

Color = tuple[int, int, int]

VIEW_WIDTH, VIEW_HEIGHT = 600, 540
GAP = 28
HEADER_HEIGHT = 118
LABEL_HEIGHT = 30
CARD_HEIGHT = 262
LEGEND_HEIGHT = 46
TITLE_SIZE, TEXT_SIZE, SMALL_SIZE = 38, 20, 17
LINE_HEIGHT = 33
COLUMNS = (22, 190, 490, 740)
"""Left edges of a card's columns: what, predicted, true, verdict."""

GREY = (112, 116, 126)
RULE = (218, 220, 226)
GREEN = (22, 128, 60)
RED = (196, 38, 34)

GOOD_CM, GOOD_DEG = 2.0, 10.0
"""Errors up to these are printed green: two voxels and two bins of the paper's grid."""


def draw_sheet(inspection: Inspection, origin: str) -> Image.Image:
    """Three views side by side above one card per arm.

    Args:
        inspection: what to draw.
        origin: which policy and which sample, for the line below the title.
    """
    width = GAP + len(VIEW_DIRECTIONS) * (VIEW_WIDTH + GAP)
    cards_top = HEADER_HEIGHT + LABEL_HEIGHT + VIEW_HEIGHT + GAP
    sheet = Image.new("RGB", (width, cards_top + CARD_HEIGHT + LEGEND_HEIGHT + GAP), PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((GAP, GAP), f"“{inspection.instruction}”", fill=INK, font=_font(TITLE_SIZE))
    subtitle = f"keypose step {inspection.keypose_step}   ·   {origin}"
    draw.text((GAP, GAP + TITLE_SIZE + 16), subtitle, fill=GREY, font=_font(TEXT_SIZE))
    for column, direction in enumerate(VIEW_DIRECTIONS):
        left = GAP + column * (VIEW_WIDTH + GAP)
        draw.text((left, HEADER_HEIGHT), direction.name, fill=GREY, font=_font(SMALL_SIZE))
        view = draw_scene(inspection, direction, VIEW_WIDTH, VIEW_HEIGHT)
        sheet.paste(view, (left, HEADER_HEIGHT + LABEL_HEIGHT))
    card_width = (width - 3 * GAP) // 2
    for arm in inspection.arms:
        _draw_card(draw, arm, GAP + arm.arm.ordinal * (card_width + GAP), cards_top, card_width)
    _draw_legend(draw, GAP, cards_top + CARD_HEIGHT + LEGEND_HEIGHT // 2 + 4)
    return sheet


def _draw_card(draw: ImageDraw.ImageDraw, arm: ArmInspection, left: int, top: int, width: int) -> None:
    draw.rounded_rectangle((left, top, left + width, top + CARD_HEIGHT), radius=10, outline=RULE, width=2)
    draw.rounded_rectangle((left, top, left + 10, top + CARD_HEIGHT), radius=5, fill=ARM_COLORS[arm.arm])
    rows = [
        (f"{arm.arm} arm", "predicted", "true", "", GREY),
        (
            "position [m]",
            _position(arm.predicted),
            _position(arm.true),
            *_error(arm.position_error_cm, " cm", GOOD_CM),
        ),
        (
            "angles xyz [°]",
            _angles(arm.predicted),
            _angles(arm.true),
            *_error(arm.rotation_error_deg, "°", GOOD_DEG),
        ),
        (
            "gripper",
            *_flags(arm.predicted.gripper_open, arm.true.gripper_open, ("closed", "open")),
            *_verdict(arm.predicted.gripper_open == arm.true.gripper_open, arm.gripper_probability),
        ),
        (
            "collisions",
            *_flags(arm.predicted.ignore_collisions, arm.true.ignore_collisions, ("avoided", "ignored")),
            *_verdict(
                arm.predicted.ignore_collisions == arm.true.ignore_collisions, arm.collision_probability
            ),
        ),
    ]
    for number, (*cells, color) in enumerate(rows):
        middle = top + 24 + number * LINE_HEIGHT
        for column, text in zip(COLUMNS, cells, strict=True):
            last, heading = column == COLUMNS[-1], number == 0 and column == COLUMNS[0]
            fill = ARM_COLORS[arm.arm] if heading else GREY if number == 0 or column == COLUMNS[0] else INK
            size = TEXT_SIZE + 3 if heading else TEXT_SIZE
            draw.text(
                (left + column, middle), text, fill=color if last else fill, font=_font(size), anchor="lm"
            )
    line = top + 24 + len(rows) * LINE_HEIGHT
    draw.line((left + COLUMNS[0], line - 14, left + width - COLUMNS[0], line - 14), fill=RULE, width=2)
    rotation = " / ".join(_percent(probability) for probability in arm.rotation_probabilities)
    top_three = ",  ".join(_percent(heat) for heat in arm.heat[:-4:-1])
    for number, (what, text) in enumerate(
        (
            ("voxels", f"most probable {top_three};   true voxel {_percent(arm.true_voxel_probability)}"),
            ("angle bins", f"chosen, about x / y / z: {rotation}"),
        )
    ):
        middle = line + 8 + number * (LINE_HEIGHT - 3)
        draw.text((left + COLUMNS[0], middle), what, fill=GREY, font=_font(TEXT_SIZE), anchor="lm")
        draw.text((left + COLUMNS[1], middle), text, fill=INK, font=_font(TEXT_SIZE), anchor="lm")


def _draw_legend(draw: ImageDraw.ImageDraw, left: int, middle: int) -> None:
    entries = [
        *((f"{arm} arm: heat and predicted hand", color) for arm, color in ARM_COLORS.items()),
        ("true hand", INK),
        *zip(("hand x", "hand y (fingers open)", "hand z (out of the palm)"), AXIS_COLORS, strict=True),
    ]
    font = _font(SMALL_SIZE)
    for text, color in entries:
        draw.rounded_rectangle((left, middle - 7, left + 22, middle + 7), radius=4, fill=color)
        draw.text((left + 30, middle), text, fill=GREY, font=font, anchor="lm")
        left += 30 + round(draw.textlength(text, font=font)) + 34


def _position(keypose: Keypose) -> str:
    return "   ".join(f"{value:+.3f}" for value in keypose.pose.position)


def _angles(keypose: Keypose) -> str:
    angles_deg = np.rad2deg(quat_wxyz_to_euler_xyz(keypose.pose.quat_wxyz)).round().astype(int)
    return "   ".join(f"{value:+d}" for value in angles_deg)


def _flags(predicted: bool, true: bool, words: tuple[str, str]) -> tuple[str, str]:
    return words[predicted], words[true]


def _error(value: float, unit: str, good: float) -> tuple[str, Color]:
    return f"{value:.1f}{unit} off", GREEN if value <= good else RED


def _verdict(right: bool, probability: float) -> tuple[str, Color]:
    return f"{'right' if right else 'wrong'} ({_percent(probability)})", GREEN if right else RED


def _percent(probability: float) -> str:
    return f"{100 * probability:.3g} %" if probability > 1e-4 else "< 0.01 %"


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)
