"""LeRobot's other tools take our datasets; where one cannot, the test says what it does instead."""

import json
import os
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.scripts import lerobot_edit_dataset

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

RGB, DEPTH = schema.image_key("front"), schema.depth_key("front")
REENCODED = 0.01
"""Mean error of RGB, of 1, that encoding a video once more at the same quality may cost."""

STREAM = """
import json, sys
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset
for root in sys.argv[1:]:
    stored = LeRobotDataset("local/small", root=root, video_backend="pyav")
    stream = StreamingLeRobotDataset("local/small", root=root, shuffle=False, buffer_size=1, max_num_shards=1)
    rows, different, error = [], set(), ""
    try:
        for item in stream:
            rows.append(int(item["index"]))
            for key, value in stored[rows[-1]].items():
                is_text = isinstance(value, str)
                same = value == item[key] if is_text else torch.equal(torch.as_tensor(item[key]), value)
                if not same:
                    different.add(key)
    except Exception as problem:
        error = repr(problem)
    print(json.dumps([len(stored), rows, sorted(different), error]))
"""


def run(*words: str, folder: Path, **variables: str) -> str:
    """What a command of this environment prints; offline."""
    done = subprocess.run(
        [str(Path(sys.executable).with_name(words[0])), *words[1:]],
        cwd=folder,
        env=os.environ | {"HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"} | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout


@pytest.fixture
def edit(monkeypatch):
    """Runs `lerobot-edit-dataset`, in this process because importing LeRobot takes longer than an edit."""

    def run_edit(operation: str, *flags: str, **options: object) -> None:
        words = [f"--operation.{name}={json.dumps(value)}" for name, value in options.items()]
        monkeypatch.setattr(
            sys, "argv", ["lerobot-edit-dataset", f"--operation.type={operation}", *flags, *words]
        )
        lerobot_edit_dataset.main()

    return run_edit


@pytest.fixture(scope="module")
def ffmpeg(tmp_path_factory) -> str:
    """LD_LIBRARY_PATH on which torchcodec finds FFmpeg: the libraries that PyAV brings along."""
    bundled = Path(av.__file__).parents[1] / "av.libs"
    folder = tmp_path_factory.mktemp("ffmpeg")
    for library in bundled.glob("lib[as][vw]*.so.*"):
        name, version = library.name.partition("-")[0], library.name.partition(".so.")[2].partition(".")[0]
        (folder / f"{name}.so.{version}").symlink_to(library)
    return f"{folder}:{bundled}"


def rows_of(root: Path, episode: int) -> slice:
    lengths = [len(recorded) for recorded in RecordedDataset(root).episodes()]
    return slice(sum(lengths[:episode]), sum(lengths[: episode + 1]))


def assert_episodes(edited: Path, original: Path, expected: list[int]) -> None:
    """`edited` holds the expected episodes of `original`, with all vectors, scalars and depth as they were."""
    before, after = RecordedDataset(original), RecordedDataset(edited)
    assert after.view == before.view
    assert (
        after.provenance is None
    )  # LeRobot's tools copy its own files alone; the keys of episodes are columns, and stay
    assert len(after) == len(expected)
    images, images_before = LeRobotDataset("x/y", root=edited), LeRobotDataset("x/y", root=original)
    assert images.num_frames == sum(len(recorded) for recorded in after.episodes())
    for recorded, episode in zip(after.episodes(), expected, strict=True):
        wanted = before.episode(episode)
        assert recorded.meta == wanted.meta
        for key, column in wanted.columns.items():
            assert np.array_equal(recorded.columns[key], column), key
        rows, rows_before = rows_of(edited, recorded.index), rows_of(original, episode)
        for row, row_before in ((rows.start, rows_before.start), (rows.stop - 1, rows_before.stop - 1)):
            found, stored = images[row], images_before[row_before]
            assert np.array_equal(found[DEPTH], stored[DEPTH])
            assert np.abs(found[RGB] - stored[RGB]).mean() <= (REENCODED if before.view == "frames" else 0)


def test_episodes_are_deleted(generated, tmp_path, edit) -> None:
    view = "keyframes"
    place = (f"--root={generated / view}", "--repo_id=local/small", "--new_repo_id=local/fewer")
    edit("delete_episodes", *place, f"--new_root={tmp_path / 'fewer'}", episode_indices=[0])
    assert_episodes(tmp_path / "fewer", generated / view, [1, 2])


@pytest.mark.parametrize("view", schema.VIEWS)
def test_a_dataset_is_split_and_merged_again(generated, tmp_path, edit, view) -> None:
    place = (f"--root={generated / view}", "--repo_id=local/small")
    edit("split", *place, f"--new_root={tmp_path}", splits={"even": [0, 2], "odd": [1]})
    parts = [tmp_path / "even", tmp_path / "odd"]
    assert_episodes(parts[0], generated / view, [0, 2])
    assert_episodes(parts[1], generated / view, [1])
    edit(
        "merge",
        "--new_repo_id=local/whole",
        f"--new_root={tmp_path / 'whole'}",
        repo_ids=["local/even", "local/odd"],
        roots=[str(part) for part in parts],
    )
    assert_episodes(tmp_path / "whole", generated / view, [0, 2, 1])


def test_features_are_removed(generated, tmp_path, edit) -> None:
    view = "frames"
    place = (f"--root={generated / view}", "--repo_id=local/small", "--new_repo_id=local/lean")
    wrist = [schema.image_key("left_wrist"), schema.depth_key("left_wrist")]
    edit("remove_feature", *place, f"--new_root={tmp_path / 'lean'}", feature_names=wrist)
    assert RecordedDataset(tmp_path / "lean").cameras == ("front",)
    assert_episodes(tmp_path / "lean", generated / view, [0, 1, 2])


def test_streaming_gives_the_rows_that_are_stored(generated, tmp_path, edit, ffmpeg) -> None:
    frames = generated / "frames"
    packed = ("--new_repo_id=local/packed", f"--new_root={tmp_path / 'packed'}")
    edit("merge", *packed, repo_ids=["local/small"], roots=[str(frames)])
    assert_episodes(tmp_path / "packed", frames, [0, 1, 2])
    roots = [str(root) for root in (generated / "keyframes", tmp_path / "packed", frames)]
    output = run("python", "-c", STREAM, *roots, folder=tmp_path, LD_LIBRARY_PATH=ffmpeg)
    keyframes, one_file, two_files = (
        json.loads(line) for line in output.splitlines() if line.startswith("[")
    )
    for length, rows, different, error in (keyframes, one_file):
        assert (sorted(rows), different, error) == (list(range(length)), [], "")
    # LeRobot takes the row's number in the dataset for the frame's number in its file, so it reads past the end of
    # every file but the first. If this fails, that is mended: tell so in docs/datasets.md.
    assert "IndexError('Invalid frame index" in two_files[3]
    assert len(two_files[1]) < two_files[0]


def test_the_viewer_draws_both_views(generated, tmp_path) -> None:
    pytest.importorskip("rerun", reason="needs lerobot[viz]")
    for view in schema.VIEWS:
        flags = (
            "--repo-id=local/small",
            f"--root={generated / view}",
            "--episode-index=1",
            "--num-workers=0",
        )
        run("lerobot-dataset-viz", *flags, "--save=1", f"--output-dir={tmp_path / view}", folder=tmp_path)
        assert (tmp_path / view / "local_small_episode_1.rrd").stat().st_size > 10_000
