"""The verb that lists the axes, and what its picture shows."""

import numpy as np
import pytest

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.commands.task_perturbations import TaskPerturbationsConfig, task_perturbations
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes
from lerobot_env_bimanual.pictures.axes_sheet import Row, axes_sheet, draw_row


def test_all_axes_are_listed_with_their_levels_and_a_group_alone_if_asked_for(capsys):
    task_perturbations(TaskPerturbationsConfig())
    listed = capsys.readouterr().out
    assert [line.split()[0] for line in listed.splitlines() if line[0] != " "] == list(list_axes())
    task_perturbations(TaskPerturbationsConfig(group="words"))
    listed = capsys.readouterr().out
    assert listed.startswith("instruction  (words)")
    assert "levels 1 to 3: 1, 2, 3 steps" in listed


def test_a_row_of_the_picture_shows_every_level_and_none_is_drawn_of_what_is_not_seen(tmp_path):
    panels = draw_row(Row("fewer_cameras", "push_box", seed=0))
    black = [np.mean(panel.rgb.max(axis=-1) == 0) for panel in panels]
    assert black == pytest.approx([0, 1 / 8, 2 / 8, 3 / 8], abs=0.02)
    assert [panel.caption for panel in panels][-1] == f"level 3: {get_axis('fewer_cameras').levels[2]}"
    sheet = axes_sheet(Row("fewer_cameras", "push_box", seed=0), panels)
    assert min(sheet.size) > 100
    assert draw_row(Row("arm_late", "push_box", seed=0)) == []


def test_a_picture_of_an_unknown_kind_is_refused_before_anything_is_drawn(tmp_path):
    with pytest.raises(InvalidChoice, match=r"\.jpg"):
        task_perturbations(TaskPerturbationsConfig(picture=tmp_path / "axes.bmp"))
