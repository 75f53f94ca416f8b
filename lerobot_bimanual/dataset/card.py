"""The dataset card, `README.md`: what a stranger needs to use a dataset and to make it again."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from huggingface_hub import DatasetCardData

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.picture import PICTURE_FILE, write_picture
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.reader import read_info
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.keypose import ARM_KEYPOSE_NAMES
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.output_file import write_file

CARD_FILE = Path("README.md")
LICENSE = "apache-2.0"
TAGS = ("LeRobot", "bimanual", "mujoco", "simulation", "rgbd", "depth", "keyframe", "keypose")

CITATION = """@misc{grotz2024peract2,
  title         = {PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks},
  author        = {Markus Grotz and Mohit Shridhar and Tamim Asfour and Dieter Fox},
  year          = {2024},
  eprint        = {2407.00278},
  archivePrefix = {arXiv},
  primaryClass  = {cs.RO}
}"""

MEANINGS = {
    schema.STATE: "measured joints in rad and gripper opening, 0 closed to 1 open",
    schema.EE_POSE: "tool centre points in the world: metres, quaternion wxyz; z is the approach, y the opening",
    schema.GRIPPER_FINGERS: "travel of each finger in metres, 0 closed",
    schema.KEYPOSE_STEP: "keyposes completed so far",
    schema.CAMERA_EXTRINSICS: "world_T_camera of every camera, 4x4 row-major, OpenCV axes (x right, y down, z forward)",
    schema.CAMERA_INTRINSICS: "pinhole matrix of every camera in pixels, 3x3 row-major",
    schema.NEXT_KEYPOSE: "the keypose under way: **the label** of keypose policies",
    schema.ACTION: "joint targets in rad and gripper command of the tick, 0 closed to 1 open",
    schema.KEYFRAME: "first observation after a completed keypose, or last row of the episode",
    schema.TICK: "control tick within the episode",
    schema.STATE_HASH: "first 64 bits of the hash of the simulation's state after the tick",
    schema.TASK_NAME: "recipe of the episode: task ...",
    schema.SPLIT: "... split of the seed ...",
    schema.VARIATION: "... variation ...",
    schema.SEED: "... and seed",
}
"""Each column in words."""

VIEW_TEXT = {
    "frames": "Every control tick (20 Hz). RGB is H.264, depth lossless 12-bit HEVC in whole millimetres.",
    "keyframes": "The start of every episode, every reached keypose{intermediate} and the last observation. "
    "RGB is PNG, depth 16-bit TIFF in millimetres; both are lossless.",
}


def write_card(root: Path, repo_id: str, tags: Sequence[str] = ()) -> None:
    """Write the card of a dataset from its metadata and provenance, and the picture that it shows.

    Args:
        root: folder of the dataset.
        repo_id: LeRobot's name of the dataset.
        tags: further tags, by which the Hub finds datasets.

    Raises:
        DatasetError: the dataset has no provenance.
        UnwritableOutput: its folder cannot be written.
    """
    provenance = Provenance.of_dataset(root)
    if provenance is None:
        raise DatasetError(f"{root} has no provenance, so there is nothing to write a card from")
    write_picture(root)
    text = dataset_card(provenance, read_info(root), repo_id, tags)
    write_file(root / CARD_FILE, text)


def dataset_card(provenance: Provenance, info: dict, repo_id: str, tags: Sequence[str] = ()) -> str:
    """Text of the card.

    Args:
        provenance: where the dataset comes from.
        info: content of LeRobot's `meta/info.json`.
        repo_id: LeRobot's name of the dataset.
        tags: further tags.
    """
    parts = (
        _front_matter(tags),
        f"# {repo_id}",
        f"![The first episode: its start, every keypose and its end]({PICTURE_FILE.as_posix()})",
        *_summary(provenance, info),
        *_use(provenance, repo_id),
        "## Columns",
        _columns(info),
        *_conventions(info),
        *_origin(provenance),
        "## Licence and citation",
        f"{LICENSE}. The tasks are those of:",
        f"```bibtex\n{CITATION}\n```\n",
    )
    return "\n\n".join(parts)


def _front_matter(tags: Sequence[str]) -> str:
    data = DatasetCardData(
        license=LICENSE,
        task_categories=["robotics"],
        tags=list(dict.fromkeys((*TAGS, *tags))),
        configs=[{"config_name": "default", "data_files": "data/*/*.parquet"}],
    )
    return f"---\n{data.to_yaml()}\n---"


def _summary(provenance: Provenance, info: dict) -> Iterable[str]:
    yield (
        f"Expert demonstrations of bimanual manipulation, simulated in MuJoCo with two Franka arms: "
        f"{info['total_episodes']} episodes, {info['total_frames']} rows."
    )
    fractions = provenance.settings.get("intermediate")
    fractions = fractions if isinstance(fractions, list | tuple) else ()  # whatever a stranger's file says
    intermediate = f" and the rows at {', '.join(map(str, fractions))} of each motion" if fractions else ""
    yield VIEW_TEXT[provenance.view].format(intermediate=intermediate.replace(" and the", ", the"))
    counts = Counter((key.task, key.variation) for key in provenance.episodes)
    rows = ((*which, count) for which, count in sorted(counts.items()))
    yield markdown_table(("task", "variation", "episodes"), rows, of_words=True)


def _use(provenance: Provenance, repo_id: str) -> Iterable[str]:
    yield "## Use"
    yield (
        "```python\nfrom lerobot.datasets.lerobot_dataset import LeRobotDataset\n\n"
        f'dataset = LeRobotDataset("{repo_id}")\n```'
    )
    if provenance.view == "frames":
        yield (
            "Every episode replays: `lerobot-bimanual dataset replay --root=DIR` plays the column `action` open-loop from "
            "the recorded seed and compares the state's hash after every tick."
        )


def _columns(info: dict) -> str:
    rows = []
    for key, feature in info["features"].items():
        if key in MEANINGS:
            meaning = MEANINGS[key]
        elif feature["dtype"] in ("video", "image"):
            is_depth = (feature.get("info") or {}).get("is_depth_map")
            meaning = "depth along the optical axis" if is_depth else "RGB"
        else:
            continue  # LeRobot's own bookkeeping
        shape = " x ".join(map(str, feature["shape"]))
        rows.append((f"`{key}`", feature["dtype"], shape, meaning))
    return markdown_table(("column", "type", "shape", "meaning"), rows, of_words=True)


def _conventions(info: dict) -> Iterable[str]:
    yield (
        f"Left arm before right arm everywhere. Lengths are metres, angles radians, the world's z points up. "
        f"Per arm, `{schema.STATE}` and `{schema.ACTION}` are seven joints and the gripper; "
        f"`{schema.NEXT_KEYPOSE}` is {', '.join(ARM_KEYPOSE_NAMES)}. Calibration vectors list the cameras "
        f"{', '.join(CAMERA_NAMES)}, whichever images are stored."
    )
    yield (
        f"Depth is read as float32 millimetres (1, H, W), clipped to {schema.DEPTH_MIN_M} to "
        f"{schema.DEPTH_MAX_M} m; the lower limit means that nothing was measured, the upper one that nothing was hit. "
        f"{info['fps']} rows are a second in the view `frames`; in `keyframes` the column `tick` tells the time."
    )


def _origin(provenance: Provenance) -> Iterable[str]:
    yield "## Origin"
    versions = ", ".join(f"{package} {version}" for package, version in provenance.versions.items())
    yield f"Generated with {versions} (schema version {provenance.schema_version}) by"
    yield f"```bash\n{provenance.command}\n```"
    seeds = [key.seed for key in provenance.episodes]
    yield (
        f"Seeds {min(seeds)} to {max(seeds)} of the split `{provenance.episodes[0].split}`; "
        f"{len(provenance.skipped)} of them were skipped because the expert did not solve them. The recipe of "
        "every episode and the reason of every skipped seed stand in `meta/bimanual.json`."
    )
