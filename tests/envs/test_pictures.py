"""How pictures are laid out, and where they are taken from."""

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.pictures.layout import (
    CAPTION_HEIGHT,
    GAP,
    GREEN,
    PANEL_WIDTH,
    SEAM,
    Panel,
    contact_sheet,
    gallery,
    moving_gallery,
)
from lerobot_env_bimanual.pictures.viewpoint import ZOOM, clearest_camera, close_up
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.scene import Scene

RED_RGB = (200, 10, 10)
PITCH = np.array([300 + CAPTION_HEIGHT, PANEL_WIDTH]) + GAP
"""Rows and columns from one panel of 3:4 to the next."""


def red(**options) -> Panel:
    return Panel(np.full((30, 40, 3), RED_RGB, dtype=np.uint8), "caption", **options)


def red_rows_and_columns(image) -> tuple[np.ndarray, np.ndarray]:
    is_red = (np.asarray(image) == RED_RGB).all(axis=-1)
    return np.nonzero(is_red.any(axis=1))[0], np.nonzero(is_red.any(axis=0))[0]


def test_a_gallery_fills_its_rows_and_centres_the_last() -> None:
    image = gallery([red() for _ in range(4)], columns=3)
    assert (image.height, image.width) == tuple(PITCH * (2, 3) + GAP)
    _, columns = red_rows_and_columns(image.crop((0, PITCH[0], *image.size)))
    assert columns.min() == GAP + PITCH[1]
    assert len(columns) == PANEL_WIDTH


def test_a_contact_sheet_starts_every_row_at_the_left_and_has_room_for_its_title() -> None:
    panels = [red() for _ in range(4)]
    sheet = contact_sheet("title", ["line", "line"], panels, columns=3)
    header = sheet.height - gallery(panels, columns=3).height
    rows, _ = red_rows_and_columns(sheet)
    assert rows.min() == header + GAP
    title = np.asarray(sheet)[:header]
    assert (title < 100).any()
    _, columns = red_rows_and_columns(sheet.crop((0, header + PITCH[0], *sheet.size)))
    assert columns.min() == GAP


def test_few_panels_make_a_narrow_sheet() -> None:
    assert gallery([red(), red()]).width == 2 * PITCH[1] + GAP


def test_a_second_picture_stands_beside_the_first_at_its_height() -> None:
    green = np.full((20, 20, 3), GREEN, dtype=np.uint8)
    image = np.asarray(gallery([red(beside=green)]))
    assert image.shape[1] == 2 * GAP + PANEL_WIDTH + SEAM + 300
    assert (image[GAP : GAP + 300, GAP : GAP + PANEL_WIDTH] == RED_RGB).all()
    assert (image[GAP : GAP + 300, GAP + PANEL_WIDTH + SEAM : -GAP] == GREEN).all()


def test_text_stands_below_the_picture_and_color_frames_it() -> None:
    plain, framed = (np.asarray(gallery([panel])) for panel in (red(), red(note="1 s", color=GREEN)))
    assert (plain[GAP : GAP + 300, GAP : GAP + PANEL_WIDTH] == RED_RGB).all()
    assert (plain[GAP + 300 :] < 100).any()
    assert tuple(framed[GAP, GAP]) == GREEN
    assert tuple(framed[GAP + 150, GAP + PANEL_WIDTH // 2]) == RED_RGB


def test_a_moving_gallery_shows_one_moment_of_every_episode_at_a_time() -> None:
    def strip(*values: int) -> list[np.ndarray]:
        return [np.full((30, 40, 3), value, dtype=np.uint8) for value in values]

    moments = moving_gallery(
        {"first": strip(10, 20), "second": strip(30, 40), "third": strip(50, 60)}, columns=2
    )
    shown = [np.asarray(moment) for moment in moments]
    corners = [(GAP, GAP), (GAP, 2 * GAP + 40), (2 * GAP + 30 + CAPTION_HEIGHT, GAP + (GAP + 40) // 2)]
    for moment, values in zip(shown, ((10, 30, 50), (20, 40, 60)), strict=True):
        for (top, left), value in zip(corners, values, strict=True):
            assert (moment[top : top + 30, left : left + 40] == value).all()


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene([Block(), Box()])


@pytest.mark.parametrize("camera", FIXED_CAMERAS, ids=lambda camera: camera.name)
def test_the_clearest_camera_is_one_that_the_moved_thing_is_not_hidden_from(scene, camera):
    block_m = np.array([0.27, 0.05, 0.80])
    wall_m = block_m + 0.3 * (np.array(camera.position) - block_m) / np.linalg.norm(camera.position - block_m)
    states = []
    for move_m in (-0.03, 0.03):
        scene.reset()
        scene.place("box", Pose.upright(wall_m, np.arctan2(*(wall_m - block_m)[:2])))
        scene.place("item", Pose.upright(block_m + np.array([move_m, 0, 0])))
        states.append(scene.save_state())
    assert clearest_camera(scene, states) != camera.name


def test_a_close_up_shows_the_place_between_the_hands(scene) -> None:
    scene.reset()
    rows, columns = np.mgrid[:240, :320].astype(np.uint16)
    crop = np.stack([rows, columns, rows], axis=-1)[close_up(scene, "left_shoulder", *rows.shape)]
    assert crop.shape == (round(240 / ZOOM), round(320 / ZOOM), 3)
    # The hands are at home, high above the table: the close-up is the picture's upper part.
    assert crop[..., 0].min() == 0
    assert 0 < crop[..., 1].min() < crop[..., 1].max() < 319
