"""A generated dataset passes every check, and each kind of damage is found by the check that is meant for it."""

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import av
import damages
import numpy as np
import pyarrow.parquet as pq
import pytest
from lerobot.utils.constants import DEFAULT_FEATURES
from PIL import Image

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import BOOKKEEPING, COLUMN_TYPES, RecordedDataset
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_env_bimanual.verification.bookkeeping import ENTRY, VIDEO_ENTRY
from lerobot_env_bimanual.verification.fault import faults_of as checked
from lerobot_env_bimanual.verification.metadata import NAMED_FILES, check_description, check_schema
from lerobot_env_bimanual.verification.rendering import ALL_ROWS
from lerobot_env_bimanual.verification.simulation import COMPARED, Player
from lerobot_env_bimanual.verification.verifier import Thoroughness, Verifier, verify_metadata

pytestmark = pytest.mark.sim

FRONT, FRONT_DEPTH = schema.image_key("front"), schema.depth_key("front")
FIRST_FILE = "data/chunk-000/file-000.parquet"


def faults_of(root: Path, simulate: bool = False, episode: int = 1) -> dict[str, str]:
    """Failed checks of an episode but its statistics, with all they say."""
    player = Player()
    report = Verifier(root, Thoroughness(simulate, ALL_ROWS), player).verify(episode)
    player.close()
    return {
        check: "; ".join(f"{fault.row}: {fault.text}" for fault in faults)
        for check, faults in report.faults.items()
        if faults and check != "statistics"
    }


# -- images -------------------------------------------------------------------------------------------------


def test_a_video_of_other_length_is_found(copy) -> None:
    root = copy("frames")
    folder = root / "videos" / FRONT / "chunk-000"
    shutil.copyfile(folder / "file-001.mp4", folder / "file-000.mp4")
    assert faults_of(root).keys() == {"images complete"}
    rows = len(RecordedDataset(root).episode(1))
    assert f"{FRONT} has 0 images, but the episode {rows} rows" in faults_of(root)["images complete"]


def test_a_video_that_is_cut_off_or_gone_is_found(copy) -> None:
    root = copy("frames")
    file = root / "videos" / FRONT_DEPTH / "chunk-000" / "file-000.mp4"
    file.write_bytes(file.read_bytes()[:1000])
    assert "cannot decode" in faults_of(root)["images complete"]
    file.unlink()
    assert "No such file" in faults_of(root)["images complete"]


def test_the_video_of_another_camera_is_found(copy) -> None:
    root = copy("frames")
    for key, other in (
        (FRONT, schema.image_key("left_wrist")),
        (FRONT_DEPTH, schema.depth_key("left_wrist")),
    ):
        file = Path("chunk-000", "file-000.mp4")
        shutil.copyfile(root / "videos" / other / file, root / "videos" / key / file)
    found = faults_of(root, simulate=True)
    assert found.keys() == {"rendered RGB", "rendered depth"}
    assert f"0: {FRONT} is unlike a new image" in found["rendered RGB"]


def encode_again(file: Path, change: Callable[[list[np.ndarray]], list[np.ndarray]]) -> None:
    """Decode a video of colours, change its frames, and encode them as before."""
    with av.open(str(file)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    with av.open(str(file), "w") as container:
        stream = container.add_stream("libx264", rate=CONTROL_HZ, options={"crf": "18"})
        stream.height, stream.width, stream.pix_fmt = *frames[0].shape[:2], "yuv420p"
        for pixels in change(frames):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), "rgb24")))
        container.mux(stream.encode())


@pytest.mark.parametrize(
    ("change", "shown"),
    [
        (lambda frames: frames, None),
        (lambda frames: [frames[0], *frames[:-1]], "the tick before"),
        (lambda frames: [*frames[1:], frames[-1]], "the tick after"),
        (lambda frames: [frame[..., ::-1] for frame in frames], "exchanged red and blue"),
    ],
    ids=["only encoded again", "late", "early", "BGR"],
)
def test_a_video_out_of_step_or_in_wrong_colours_is_found(copy, change, shown) -> None:
    root = copy("frames")
    encode_again(root / "videos" / FRONT / "chunk-000" / "file-000.mp4", change)
    found = faults_of(root, simulate=True)
    assert list(found) == ([] if shown is None else ["rendered RGB"])
    assert shown is None or f"{FRONT} shows {shown}" in found["rendered RGB"]


def test_an_image_that_is_missing_is_found(copy) -> None:
    root = copy("keyframes")

    def remove(images: list, rows: np.ndarray) -> None:
        images[rows[2]] = None

    damages.edit(root, FIRST_FILE, FRONT, remove)
    assert faults_of(root)["images complete"].startswith(f"2: row 2 of {FRONT}")


def changed_image(content: bytes, change: Callable[[np.ndarray], None]) -> bytes:
    image = Image.open(io.BytesIO(content))
    pixels = np.array(image)
    change(pixels)
    changed = io.BytesIO()
    Image.fromarray(pixels).save(changed, format=image.format)
    return changed.getvalue()


def add_to_one_pixel(amount: int) -> Callable[[list, np.ndarray], None]:
    def add(pixels: np.ndarray) -> None:
        pixels.flat[40] = int(pixels.flat[40]) + amount

    def change(images: list, rows: np.ndarray) -> None:
        images[rows[3]]["bytes"] = changed_image(images[rows[3]]["bytes"], add)

    return change


def test_one_pixel_of_depth_and_one_of_colour_are_found(copy) -> None:
    root = copy("keyframes")
    damages.edit(root, FIRST_FILE, FRONT_DEPTH, add_to_one_pixel(-5))
    damages.edit(root, FIRST_FILE, FRONT, add_to_one_pixel(1))
    assert faults_of(root, simulate=True) == {
        "rendered depth": f"3: {FRONT_DEPTH} is wrong by up to 5 mm",
        "rendered RGB": f"3: {FRONT} differs from a new image in 1 pixels",
    }


def test_depth_beyond_its_range_is_found(copy) -> None:
    root = copy("keyframes")
    damages.edit(root, FIRST_FILE, FRONT_DEPTH, add_to_one_pixel(9000))
    assert faults_of(root).keys() == {"depth range"}
    assert "beyond 10 to 4000 mm" in faults_of(root)["depth range"]


# -- columns ------------------------------------------------------------------------------------------------


def shift_by_a_stage(labels: list, rows: np.ndarray) -> None:
    stages = sorted(
        {tuple(labels[row]) for row in rows}, key=lambda stage: [tuple(x) for x in labels].index(stage)
    )
    following = dict(zip(stages, [*stages[1:], stages[0]], strict=True))
    for row in rows:
        labels[row] = list(following[tuple(labels[row])])


def test_labels_of_the_next_stage_are_found(copy) -> None:
    root = copy("frames")
    damages.edit(root, FIRST_FILE, schema.NEXT_KEYPOSE, shift_by_a_stage)
    assert faults_of(root)["labels"].partition(": ")[2] == (
        "next_keypose is not where the stage's motion ends (and 1 more rows)"
    )
    root = copy("keyframes")
    damages.edit(root, FIRST_FILE, schema.NEXT_KEYPOSE, shift_by_a_stage)
    assert "replayed keyposes" in faults_of(root, simulate=True)


def test_a_label_that_changes_within_a_stage_is_found(copy) -> None:
    root = copy("keyframes")

    def move(labels: list, rows: np.ndarray) -> None:
        labels[rows[1]][0] += 0.01

    damages.edit(root, FIRST_FILE, schema.NEXT_KEYPOSE, move)
    assert faults_of(root) == {"labels": "1: next_keypose changes within a stage"}


def swap_cameras(first: int, second: int, some_rows: slice) -> Callable[[list, np.ndarray], None]:
    def swap(extrinsics: list, rows: np.ndarray) -> None:
        for row in rows[some_rows]:
            poses = np.reshape(extrinsics[row], (5, 16))
            poses[[first, second]] = poses[[second, first]]
            extrinsics[row] = poses.ravel().tolist()

    return swap


@pytest.mark.parametrize(
    ("first", "second", "some_rows", "text"),
    [
        (0, 1, slice(2, 3), "2: camera front is not fixed to the world"),
        (3, 4, slice(None), "camera left_wrist is not fixed to the left hand"),
    ],
)
def test_cameras_that_come_loose_are_found_without_simulation(copy, first, second, some_rows, text) -> None:
    root = copy("frames")
    damages.edit(root, FIRST_FILE, schema.CAMERA_EXTRINSICS, swap_cameras(first, second, some_rows))
    assert faults_of(root).keys() == {"calibration"}
    assert text in faults_of(root)["calibration"]


def test_two_cameras_exchanged_throughout_are_found_by_the_simulation(copy) -> None:
    root = copy("keyframes")
    damages.edit(root, FIRST_FILE, schema.CAMERA_EXTRINSICS, swap_cameras(0, 1, slice(None)))
    assert faults_of(root, simulate=True) == {
        "replayed observations": f"0: {schema.CAMERA_EXTRINSICS} is not what the simulation says "
        "(and 6 more rows)"
    }


def test_keyframes_that_do_not_follow_the_keyposes_are_found(copy) -> None:
    root = copy("frames")

    def flag(flags: list, rows: np.ndarray) -> None:
        flags[rows[5]] = True

    def jump(steps: list, rows: np.ndarray) -> None:
        steps[rows[-1]] += 2

    damages.edit(root, FIRST_FILE, schema.KEYFRAME, flag)
    assert faults_of(root) == {"keyframes": "5: keyframe is set, but no keypose was completed"}
    damages.edit(root, FIRST_FILE, schema.KEYPOSE_STEP, jump)
    last = len(RecordedDataset(root).episode(1)) - 1
    assert f"{last}: keypose_step does not stay or rise by one" in faults_of(root)["keyframes"]


def test_a_changed_action_is_found_at_its_row(copy) -> None:
    root = copy("frames")

    def nudge(actions: list, rows: np.ndarray) -> None:
        actions[rows[30]][0] += 0.01

    damages.edit(root, FIRST_FILE, schema.ACTION, nudge)
    assert faults_of(root, simulate=True) == {
        "replayed actions": "30: action is not what the simulation says"
    }


def test_a_row_out_of_order_and_one_of_another_episode_are_found(copy) -> None:
    root = copy("frames")

    def exchange(ticks: list, rows: np.ndarray) -> None:
        ticks[rows[7]], ticks[rows[8]] = ticks[rows[8]], ticks[rows[7]]

    def reseed(seeds: list, rows: np.ndarray) -> None:
        seeds[rows[9]] = 77

    damages.edit(root, FIRST_FILE, schema.TICK, exchange)
    damages.edit(root, FIRST_FILE, schema.SEED, reseed)
    assert faults_of(root) == {
        "rows": "7: tick does not follow the row before (and 2 more rows)",
        "episode key": "9: seed changes within the episode",
    }


# -- the dataset as a whole ---------------------------------------------------------------------------------


def metadata_faults(root: Path) -> dict[str, str]:
    return {
        check: "; ".join(fault.text for fault in faults)
        for check, faults in verify_metadata(root).items()
        if faults
    }


def test_what_the_metadata_claim_is_compared_with_what_is_there(copy) -> None:
    root = copy("keyframes")
    assert not metadata_faults(root)
    damages.fields(total_frames=20)(root)
    damages.provenance(lambda origin: origin["episodes"].append(origin["episodes"][0]))(root)
    table = pq.read_table(root / FIRST_FILE)
    pq.write_table(table.drop_columns([schema.SEED]), root / FIRST_FILE)
    found = metadata_faults(root)
    expected = {"seal", "description", "provenance", "plan", "table columns", "card"}
    assert found.keys() == expected | {"statistics of the dataset"}  # which need the plan of shards
    assert "total_frames is 20, not 21" in found["description"]
    assert "lists 4 episodes, but there are 3" in found["provenance"]
    assert "seed=0) is there 2 times" in found["provenance"]
    assert "['seed']" in found["table columns"]


# -- nothing is left out ------------------------------------------------------------------------------------


def test_every_column_is_compared_with_the_simulation_or_kept_by_lerobot() -> None:
    assert COMPARED.keys() == schema.VECTORS.keys() | schema.SCALARS.keys()
    assert BOOKKEEPING.keys() == DEFAULT_FEATURES.keys()
    assert COLUMN_TYPES.keys() == COMPARED.keys() | BOOKKEEPING.keys()


@pytest.mark.parametrize("view", schema.VIEWS)
def test_every_field_that_is_changed_is_found(copy, view: schema.View) -> None:
    """A feature, a field or a column that LeRobot or we add fails here until something checks it."""
    root = copy(view)
    file = root / "meta/info.json"
    text = file.read_text()
    described = json.loads(text)
    for name in described.keys() - {"features"}:
        damages.fields(**{name: "other"})(root)
        assert checked(check_description, root), name
        file.write_text(text)
    for key in described["features"]:
        damages.info(lambda info, key=key: info["features"][key].update(info={"other": 1}))(root)
        assert checked(check_schema, root), key
        file.write_text(text)
    videos = [key for key, feature in described["features"].items() if feature["dtype"] == "video"]
    names = pq.read_schema(root / "meta/episodes/chunk-000/file-000.parquet").names
    assert {name for name in names if not name.startswith("stats/")} == {
        *ENTRY,
        *(f"videos/{key}/{part}" for key in videos for part in VIDEO_ENTRY),
    }
    numeric = {key for key, feature in described["features"].items() if feature["dtype"] != "string"}
    assert {name.split("/")[1] for name in names if name.startswith("stats/")} == numeric
    files = {path.relative_to(root).as_posix() for path in root.glob("*") if path.is_file()}
    files |= {path.relative_to(root).as_posix() for path in root.glob("meta/*") if path.is_file()}
    assert files == {path if isinstance(path, str) else path.as_posix() for path in NAMED_FILES}
