"""Made-up episodes, datasets of them, and recipes of made-up policies."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM

STAGE_TICKS = (12, 9)
MOTION_TICKS = (8, 5)
"""Two stages, each a motion followed by waiting."""

CAMERAS = ("front", "left_wrist")
SIZE = (24, 32)


@pytest.fixture(scope="session")
def make_episode() -> Callable[[int], Demonstration]:
    """Builds the same random episode of 21 ticks for the same seed."""
    return _make_episode


@pytest.fixture(scope="session")
def calibration() -> Calibration:
    """That of all made-up episodes."""
    return Calibration.of_observation(_make_episode(0).final_observation)


@pytest.fixture(scope="session")
def write_view(calibration) -> Callable[..., Path]:
    """Writes the episodes of some seeds into a new folder, as one view, and gives the folder."""
    from lerobot_bimanual.dataset.writer import ViewWriter, write_episode

    def write(root: Path, view: schema.View, *seeds: int, cameras: tuple[str, ...] = CAMERAS) -> Path:
        with ViewWriter(root, "local/part", view, cameras, *SIZE, (0.5,), calibration=calibration) as writer:
            for seed in seeds:
                write_episode(_make_episode(seed), [writer])
        return root

    return write


@pytest.fixture(scope="session")
def datasets(write_view, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folder per view of a dataset that holds the episodes of seeds 0 and 1."""
    root = tmp_path_factory.mktemp("datasets")
    return {view: write_view(root / view, view, 0, 1) for view in schema.VIEWS}


RECIPE = """
dataset: {{repo_id: local/demonstrations, root: data/keyframes}}
steps: 4
batch_size: 2
save_freq: 2
policy: {{type: {policy}, depth: 3, shift: [0.5, 0], head: null, name: plain}}
"""


@pytest.fixture
def install_recipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Installs a distribution with the recipe `small` for one policy, and gives the recipe's file."""

    def install(policy: str, recipe: str = RECIPE) -> Path:
        site = tmp_path / f"site_{policy}"
        file = site / f"package_of_{policy}" / "recipes" / "small.yaml"
        file.parent.mkdir(parents=True)
        file.write_text(recipe.format(policy=policy))
        (file.parents[1] / "__init__.py").write_text("raise ImportError('found without an import')")
        metadata = site / f"{policy}-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {policy}\nVersion: 1.0\n")
        entry = f"[lerobot_bimanual.recipes]\n{policy} = package_of_{policy}\n"
        (metadata / "entry_points.txt").write_text(entry)
        monkeypatch.syspath_prepend(site)
        return file

    return install


def _make_episode(seed: int) -> Demonstration:
    rng = np.random.default_rng(seed)
    ticks = sum(STAGE_TICKS)

    def observation(stage: int) -> dict[str, np.ndarray]:
        vectors = {key: rng.normal(size=len(each)).astype(np.float32) for key, each in schema.VECTORS.items()}
        vectors[schema.CAMERA_EXTRINSICS][:48] = 0.5  # of the cameras in the room
        vectors[schema.CAMERA_INTRINSICS][:] = range(len(schema.INTRINSIC_NAMES))
        return vectors | {schema.KEYPOSE_STEP: np.array([stage], dtype=np.float32)}

    steps = []
    for stage, (stage_ticks, motion_ticks) in enumerate(zip(STAGE_TICKS, MOTION_TICKS, strict=True)):
        actions = rng.normal(size=(motion_ticks, len(schema.JOINT_NAMES))).astype(np.float32)
        for tick in range(stage_ticks):
            state_hash = int(rng.integers(-(2**63), 2**63 - 1))
            steps.append(Step(observation(stage), actions[min(tick, motion_ticks - 1)], stage, state_hash))
    images = [_images(row) for row in range(ticks + 1)]
    return Demonstration(
        meta=EpisodeMeta("lift_ball", 0, "train", seed, "lift the ball"),
        keyposes=rng.normal(size=(len(STAGE_TICKS), KEYPOSE_DIM)).astype(np.float32),
        steps=tuple(steps),
        final_observation=observation(len(STAGE_TICKS)),
        images=images.__getitem__,
    )


def _images(row: int) -> dict[str, np.ndarray]:
    """A smooth picture that differs between rows and cameras."""
    height, width = SIZE
    y, x = np.mgrid[:height, :width]
    images = {}
    for index, camera in enumerate(CAMERAS):
        rgb = np.stack([4 * x + 2 * row, 5 * y + 40 * index, np.full_like(x, 10 * row)], axis=-1)
        images[schema.image_key(camera)] = rgb.clip(0, 255).astype(np.uint8)
        depth_mm = 10.0 + 3990.0 * (x + width * y + row) / (width * height + 30)
        images[schema.depth_key(camera)] = depth_mm.astype(np.float32)[None]
    return images
