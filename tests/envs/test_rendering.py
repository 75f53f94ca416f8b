"""How pictures are laid out, and where they are taken from."""

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.commands.task_perturbations import TaskPerturbationsConfig, task_perturbations
from lerobot_env_bimanual.perturbations.registry import list_axes
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.rendering.layout import (
    CAPTION_HEIGHT,
    GAP,
    GREEN,
    PANEL_WIDTH,
    Panel,
    contact_sheet,
    gallery,
)
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.scene import Scene

RED_RGB = (200, 10, 10)
PITCH = np.array([300 + CAPTION_HEIGHT, PANEL_WIDTH]) + GAP
"""Rows and columns from one panel of 3:4 to the next."""


def red(**options) -> Panel:
    return Panel(np.full((30, 40, 3), RED_RGB, dtype=np.uint8), "caption", **options)


def first_red(image) -> tuple[int, int]:
    is_red = (np.asarray(image) == RED_RGB).all(axis=-1)
    return int(np.nonzero(is_red.any(axis=1))[0][0]), int(np.nonzero(is_red.any(axis=0))[0][0])


def test_a_gallery_centres_its_last_row_and_a_contact_sheet_has_room_for_its_title() -> None:
    panels = [red() for _ in range(4)]
    image = gallery(panels, columns=3)
    assert (image.height, image.width) == tuple(PITCH * (2, 3) + GAP)
    assert first_red(image.crop((0, PITCH[0], *image.size)))[1] == GAP + PITCH[1]
    sheet = contact_sheet("title", ["line", "line"], panels, columns=3)
    header = sheet.height - image.height
    assert first_red(sheet) == (header + GAP, GAP)
    assert first_red(sheet.crop((0, header + PITCH[0], *sheet.size)))[1] == GAP


def test_a_colour_frames_its_picture() -> None:
    framed = np.asarray(gallery([red(color=GREEN)]))
    assert tuple(framed[GAP, GAP]) == GREEN
    assert tuple(framed[GAP + 150, GAP + PANEL_WIDTH // 2]) == RED_RGB


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


def test_all_axes_are_listed_with_their_levels_or_those_of_a_group(capsys):
    task_perturbations(TaskPerturbationsConfig())
    listed = capsys.readouterr().out
    assert [line.split()[0] for line in listed.splitlines() if line[0] != " "] == list(list_axes())
    task_perturbations(TaskPerturbationsConfig(group="words"))
    listed = capsys.readouterr().out
    assert listed.startswith("instruction  (words)")
    assert "levels 1 to 3: 1, 2, 3 steps" in listed
