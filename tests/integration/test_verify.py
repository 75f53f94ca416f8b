"""A generated dataset passes every check, and each corruption is found by the check that is meant for it."""

import shutil
from pathlib import Path

import corruptions as c
import pyarrow as pa
import pytest

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.checksums import checksum_problems, write_checksums
from lerobot_bimanual.dataset.reader import RecordedDataset, read_info
from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate
from lerobot_env_bimanual.commands.dataset_verify import DatasetVerifyConfig, dataset_verify, parse_episodes
from lerobot_env_bimanual.verification.columns import Player
from lerobot_env_bimanual.verification.rendering import ALL_ROWS
from lerobot_env_bimanual.verification.verifier import Verifier, check_files


@pytest.fixture(scope="module")
def player() -> Player:
    return Player()


def findings(root: Path, check: str, player: Player) -> dict[str, str]:
    """Failed checks of the files and, unless the check is among them, of episode 1."""
    found = check_files(root)
    if not found.get(check):
        is_played = check.startswith(("replay", "rendered"))
        found |= Verifier(root, player if is_played else None, ALL_ROWS).verify(1)
    return {name: "; ".join(fault.text for fault in faults) for name, faults in found.items() if faults}


@pytest.mark.parametrize(
    ("corruption", "view"),
    [pytest.param(c_, view, id=f"{view}: {c_.name}") for c_ in c.CORRUPTIONS for view in c_.views],
)
def test_a_corruption_is_found_by_its_check_and_by_the_checksums(corruption, view, copy, player) -> None:
    root = copy(view)
    corruption.change(root)
    assert list(checksum_problems(root)), "the checksums do not find it"
    write_checksums(root)
    found = findings(root, corruption.check, player)
    assert corruption.check in found
    assert "checksums" not in found


def test_a_video_that_is_only_encoded_again_passes_and_a_pixel_is_found_at_its_row(copy, player) -> None:
    frames, keyframes = copy("frames"), copy("keyframes")
    c.encoded_again(lambda images: images)(frames)
    assert findings(frames, "rendered RGB", player).keys() == {"checksums"}
    c.pixels(c.FRONT_DEPTH, c.one_pixel(-5), slice(3, 4))(keyframes)
    faults = Verifier(keyframes, player, ALL_ROWS).verify(1)["rendered depth"]
    assert [(fault.row, fault.text) for fault in faults] == [(3, f"{c.FRONT_DEPTH} is wrong by up to 5 mm")]


def as_polars_writes_it(rows: pa.Table) -> pa.Table:
    """The same cells in other types."""
    others = {
        pa.string(): pa.dictionary(pa.int32(), pa.string()),
        pa.int64(): pa.int32(),
        pa.list_(pa.float32()): pa.large_list(pa.float32()),
    }
    kept = rows.drop_columns([schema.STATE_HASH])
    kept = kept.cast(pa.schema([each.with_type(others.get(each.type, each.type)) for each in kept.schema]))
    return kept.append_column(schema.STATE_HASH, rows[schema.STATE_HASH])


def test_columns_of_other_types_with_the_same_values_pass(copy, player) -> None:
    root = copy("keyframes")
    c.table(as_polars_writes_it)(root)
    assert findings(root, "replay", player).keys() == {"checksums"}


def test_a_cell_or_a_playlist_cannot_make_verify_open_another_file(copy, tmp_path, monkeypatch) -> None:
    secret = tmp_path / "secret.png"
    secret.write_bytes(c.png(32, 24))
    cells, playlist = copy("keyframes"), copy("frames")
    c.column(c.FRONT, lambda _: {"bytes": None, "path": str(secret)}, [1])(cells)
    video = playlist / c.VIDEO
    video.write_text(f"#EXTM3U\n#EXTINF:1,\n{video.with_name('file-001.mp4')}\n#EXT-X-ENDLIST\n")
    opened = []
    monkeypatch.setattr("datasets.features.image.xopen", lambda *args, **_: opened.append(args))
    for root, episode in ((cells, 1), (playlist, 0)):
        write_checksums(root)
        faults = Verifier(root, None, rendered_rows=0).verify(episode)
        assert faults["images complete"]
    assert not opened


def test_a_link_is_told_and_nothing_behind_it_is_read(copy) -> None:
    root = copy("keyframes")
    (root / "README.md").unlink()
    (root / "README.md").symlink_to("/dev/zero")
    found = check_files(root)
    assert [*found] == ["readable"]
    assert "README.md" in found["readable"][0].text


def test_a_generated_dataset_passes(generated, capsys) -> None:
    assert dataset_verify(DatasetVerifyConfig(root=generated, render="2", workers=1)) == 0
    printed, said = capsys.readouterr()
    assert "not replayed" not in printed
    for check in ("replay", "rendered RGB", "rendered depth"):
        assert check in printed
    for part in ("next: ", "peract2/recipes/small.yaml", f"--dataset.root={generated}/keyframes"):
        assert part in said


def test_the_command_fails_and_says_where(generated, tmp_path, capsys) -> None:
    root = Path(shutil.copytree(generated, tmp_path / "copy"))
    c.column(schema.TICK, lambda value: value + 1, [0])(root / "keyframes")
    (root / "keyframes" / "\x1b[2Jgone").touch()
    (root / "frames/meta/info.json").write_text("[]")
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1, render="0")) == 1
    printed = capsys.readouterr().out
    assert "replay: episode 1: the ticks are " in printed
    assert "checksums: " in printed
    assert "\x1b[2J" not in printed  # a terminal would obey it
    assert "readable: " in printed  # of the view that cannot be opened
    shutil.rmtree(root / "frames")
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1, render="0")) == 1
    assert "frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("field", "other", "reason"),
    [
        ("versions", {"mujoco": "1.2.3"}, "generated with mujoco 1.2.3 (installed: "),
        ("versions", {"libc": "glibc-1.0"}, "made with the C library glibc-1.0 (here: "),
        ("worlds", {"lift_ball": "0123456789ab"}, "lift_ball in world 0123456789ab"),
    ],
)
def test_not_replayed_is_not_passed(copy, capsys, field, other, reason) -> None:
    root = copy("keyframes")
    c.provenance(lambda origin: origin[field].update(other))(root)
    write_card(root, "local/small")
    write_checksums(root)
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1)) == 3
    printed = capsys.readouterr().out
    assert "not replayed, so not passed: " in printed
    assert reason in printed
    assert "replay  " not in printed


@pytest.mark.weekly
def test_a_dataset_of_a_perturbed_world_is_complete_and_sound(small_generation, tmp_path, capsys) -> None:
    options = {"episodes": 1, "view": "keyframes", "perturb": "camera_moved:2,light:1"}
    config = small_generation(tmp_path / "made", **options)
    dataset_generate(config)
    dataset = RecordedDataset(config.root)
    assert dataset.calibration is None  # cameras stand elsewhere in every episode, so every row says where
    assert dataset.episode(0).columns[schema.CAMERA_EXTRINSICS].shape[1:] == (80,)
    dataset_generate(config)
    assert "is already complete" in capsys.readouterr().out
    assert dataset_verify(DatasetVerifyConfig(root=config.root, workers=1)) == 0
    assert "warning" not in capsys.readouterr().out


def test_by_default_only_keyframes_has_depth_and_both_views_pass(small_generation, tmp_path, capsys):
    root = tmp_path / "default"
    dataset_generate(small_generation(root, episodes=1, depth=None))
    for view in schema.VIEWS:
        stored = read_info(root / view)["features"].keys()
        assert schema.image_key("front") in stored
        assert (schema.depth_key("front") in stored) == (view == "keyframes")
    assert dataset_verify(DatasetVerifyConfig(root=root, workers=1)) == 0
    assert "not replayed" not in capsys.readouterr().out


def test_rows_that_are_no_number_are_refused(generated) -> None:
    for rows in ("-1", "some"):
        with pytest.raises(BimanualError, match="number of rows per episode, such as 3, or 'all'"):
            dataset_verify(DatasetVerifyConfig(root=generated, render=rows))


def test_episodes_are_chosen_by_index_or_range_and_refused_if_they_are_not_there() -> None:
    assert parse_episodes("all", 3) == [0, 1, 2]
    assert parse_episodes("2,0", 3) == [2, 0]
    assert parse_episodes("1:3", 3) == [1, 2]
    for text in ("3", "-1", "2:1", "x", "", "0:1000000000"):
        with pytest.raises(BimanualError, match="from 0 to 2"):
            parse_episodes(text, 3)
