"""Which rows of an episode each view stores, and what a row holds."""

import numpy as np
import pytest

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.views import row_columns, rows_of_view

TICKS, FIRST_STAGE = 21, 12
"""Of the made-up episode: motion in ticks 0 to 7 and 12 to 16, waiting in between and after."""


def test_a_state_hash_fits_into_a_signed_integer() -> None:
    assert schema.state_hash_column("00000000000000ff" + "a" * 48) == 255
    assert schema.state_hash_column("f" * 64) == -1
    assert np.int64(schema.state_hash_column("8" + "0" * 63)) == np.iinfo(np.int64).min


@pytest.mark.parametrize(
    ("view", "intermediate", "rows"),
    [
        ("frames", (0.5,), [*range(TICKS)]),
        ("keyframes", (), [0, FIRST_STAGE, TICKS]),
        ("keyframes", (0.5,), [0, 4, 12, 14, 21]),
        ("keyframes", (0.99,), [0, 8, 12, 17, 21]),
    ],
)
def test_rows_of_a_view_are_every_tick_or_stages_and_parts_of_their_motion(
    make_episode, view, intermediate, rows
) -> None:
    assert rows_of_view(make_episode(0), view, intermediate) == rows


@pytest.mark.parametrize(("view", "keyframes"), [("frames", [12, 20]), ("keyframes", [12, 21])])
def test_a_row_has_its_action_time_and_flag_and_the_last_one_repeats_keypose_and_hash(
    make_episode, view: schema.View, keyframes: list[int]
) -> None:
    episode = make_episode(0)
    rows = {row: row_columns(episode, row, view) for row in rows_of_view(episode, view)}
    assert [row for row in rows if rows[row][schema.KEYFRAME]] == keyframes
    for row, columns in rows.items():
        tick = min(row, TICKS - 1)
        stage = 0 if tick < FIRST_STAGE else 1
        action = episode.steps[tick].action if view == "frames" else episode.keyposes[stage]
        assert np.array_equal(columns[schema.ACTION], action)
        assert columns[schema.TIME] == np.float32(row * 0.05)
        assert (int(columns[schema.TICK][0]), int(columns[schema.STATE_HASH][0])) == (
            row,
            episode.steps[tick].state_hash,
        )
        seen = episode.final_observation if row == TICKS else episode.steps[row].observation
        assert np.array_equal(columns[schema.STATE], seen[schema.STATE])
