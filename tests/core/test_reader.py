"""Datasets: which rows each view stores; read back without LeRobot, and refused when they are not ours; what cards say."""

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from lerobot.utils.constants import DEFAULT_FEATURES
from sample_results import provenance

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.card import MEANINGS, write_card
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.layout import check_features
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.reader import RecordedDataset, find_view, read_info
from lerobot_bimanual.dataset.views import row_columns, rows_of_view
from lerobot_bimanual.errors import DatasetError


@pytest.fixture
def features() -> dict:
    return json.loads(json.dumps(feature_table.features(("front",), 8, 8, "frames")))


@pytest.mark.parametrize("table", ["meta/episodes", "data"])
def test_a_damaged_table_is_an_error_that_names_the_file(datasets, tmp_path, table: str) -> None:
    shutil.copytree(datasets["keyframes"], tmp_path / "copy")
    file = tmp_path / "copy" / table / "chunk-000/file-000.parquet"
    os.truncate(file, file.stat().st_size // 2)
    with pytest.raises(DatasetError, match=f"{re.escape(str(file))} is missing or damaged"):
        list(RecordedDataset(tmp_path / "copy").episodes())


def test_a_view_is_found_at_the_root_or_below_and_a_folder_without_dataset_is_an_error(datasets, tmp_path):
    assert find_view(datasets["frames"].parent, ("keyframes", "frames")) == datasets["keyframes"]
    assert find_view(datasets["frames"], ("keyframes",)) == datasets["frames"]
    with pytest.raises(DatasetError, match="no LeRobot dataset"):
        RecordedDataset(tmp_path)
    with pytest.raises(DatasetError, match=r"no dataset at .*info\.json does not exist$"):
        find_view(tmp_path)
    below = tmp_path / "one/level"
    (below / "meta").mkdir(parents=True)
    (below / "meta/info.json").touch()
    for above in (tmp_path, tmp_path / "one"):
        with pytest.raises(DatasetError, match=rf"no dataset at .* Did you mean --root={below}\?"):
            find_view(above)


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"features": []}, "features"),
        *(
            ({"features": {"observation.images.front": feature}}, r"features\.observation\.images\.front")
            for feature in (
                {},
                "image",
                {"dtype": "float32"},
                {"dtype": "image", "shape": [0, 8, 3]},
                {"dtype": "image", "shape": []},
            )
        ),
        ({"fps": 0}, "fps"),
    ],
)
def test_an_invalid_info_file_is_an_error_that_names_the_field(datasets, tmp_path, changes, place):
    root = tmp_path / "copy"
    shutil.copytree(datasets["frames"], root)
    file = root / "meta/info.json"
    info = json.loads(file.read_text())
    if isinstance(changes.get("features"), dict):
        changes = {"features": info["features"] | changes["features"]}
    for text in (json.dumps(info | changes), "[]", "{"):
        file.write_text(text)
        for reader in (RecordedDataset, ImageReader):
            with pytest.raises(DatasetError, match=place if "codebase" in text else r"meta/info\.json"):
                reader(root)


def test_our_own_features_pass_with_other_columns_and_a_mismatch_names_everything_that_differs(features):
    here = Path("here")
    check_features(features, here)
    del features[schema.depth_key("front")]
    check_features(features | {"extra": {"dtype": "float32", "shape": [1], "names": None}}, here)
    del features[schema.SEED]
    features[schema.ACTION]["shape"] = [14]
    features[schema.STATE]["names"].reverse()
    features[schema.KEYFRAME]["dtype"] = "int64"
    with pytest.raises(DatasetError) as mismatch:
        check_features(features, here)
    parts = ["seed is missing", "shape of action is [14], not [16]", "names of observation.state"]
    for part in (*parts, "dtype of keyframe is int64, not bool"):
        assert part in str(mismatch.value)


def test_a_dataset_of_another_schema_is_refused_with_what_makes_it_anew(features, tmp_path) -> None:
    features[schema.TASK_NAME]["info"] = {schema.VERSION_INFO: 2}
    with pytest.raises(DatasetError, match=r"has schema version 2, but .* reads 3: .* dataset generate"):
        check_features(features, tmp_path)


@pytest.mark.parametrize(
    "change", [lambda c: c["intrinsics"].pop("front"), lambda c: c["world_T_camera"]["front"].pop()]
)
def test_a_damaged_calibration_is_refused(datasets, tmp_path, change) -> None:
    root = shutil.copytree(datasets["frames"], tmp_path / "copy")
    info = json.loads((root / "meta/info.json").read_text())
    change(info["features"][schema.WRIST_EXTRINSICS]["info"][schema.CALIBRATION_INFO])
    (root / "meta/info.json").write_text(json.dumps(info))
    with pytest.raises(DatasetError, match=r"copy: the calibration in meta/info\.json is damaged"):
        RecordedDataset(root)


@pytest.mark.parametrize("view", schema.VIEWS)
def test_a_card_explains_every_column_and_how_to_make_the_dataset_again(datasets, tmp_path, view, snapshot):
    root = Path(shutil.copytree(datasets[view], tmp_path / view))
    provenance(view).write(root / PROVENANCE_FILE)
    write_card(root, "me/lift_ball")
    card = (root / "README.md").read_text()
    described = re.findall(r"^\| `(\S+)`", card, re.MULTILINE)
    assert read_info(root)["features"].keys() - DEFAULT_FEATURES <= {*described}
    assert feature_table.PLANS.keys() <= MEANINGS.keys()
    assert card == snapshot


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
def test_frames_has_every_tick_and_keyframes_has_stages_and_rows_within_their_motion(
    make_episode, view, intermediate, rows
):
    assert rows_of_view(make_episode(0), view, intermediate) == rows


@pytest.mark.parametrize(("view", "keyframes"), [("frames", [12, 20]), ("keyframes", [12, 21])])
def test_a_row_has_action_time_and_flag_and_the_last_repeats_keypose_and_hash(make_episode, view, keyframes):
    episode = make_episode(0)
    rows = {row: row_columns(episode, row, view) for row in rows_of_view(episode, view)}
    assert [row for row in rows if rows[row][schema.KEYFRAME]] == keyframes
    for row, columns in rows.items():
        tick = min(row, TICKS - 1)
        stage = 0 if tick < FIRST_STAGE else 1
        action = episode.steps[tick].action if view == "frames" else episode.keyposes[stage]
        assert np.array_equal(columns[schema.ACTION], action)
        assert columns[schema.TIME] == np.float32(row * 0.05)
        assert [columns[schema.TICK], columns[schema.STATE_HASH]] == [row, episode.steps[tick].state_hash]
        seen = episode.final_observation if row == TICKS else episode.steps[row].observation
        assert np.array_equal(columns[schema.STATE], seen[schema.STATE])
