"""Checkpoints: the images that a trained policy reads, known before LeRobot and torch are imported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.checksums import sha256
from lerobot_bimanual.dataset.schema import image_key
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import read_json

CONFIG_FILE, WEIGHTS_FILE = "config.json", "model.safetensors"


@dataclass(frozen=True)
class Checkpoint:
    """A folder `pretrained_model` as LeRobot leaves it.

    Attributes:
        folder: path of the folder.
        policy: type of the policy.
        cameras: cameras whose images it reads, in the order of `CAMERA_NAMES`; may be empty.
        image_size: size of these images in pixels, such as "128x128"; None without images.
        sha256: SHA-256 of its weights.
    """

    folder: Path
    policy: str
    cameras: tuple[str, ...]
    image_size: str | None
    sha256: str

    @classmethod
    def read(cls, folder: Path) -> Self:
        """The checkpoint in a folder.

        Raises:
            BimanualError: there is none, or its config is damaged.
        """
        for name in (CONFIG_FILE, WEIGHTS_FILE):
            if not (folder / name).is_file():
                raise BimanualError(
                    f"no checkpoint at {folder}: {folder / name} does not exist. Give the folder `pretrained_model` of a "
                    "training, as in outputs/peract2/checkpoints/last/pretrained_model"
                )
        config = read_json(folder / CONFIG_FILE)
        policy = config.get("type") if isinstance(config, dict) else None
        features = config.get("input_features") if isinstance(config, dict) else None
        if not isinstance(policy, str) or not isinstance(features, dict):
            raise BimanualError(f"{folder / CONFIG_FILE} names no policy `type`, or no `input_features`")
        shapes = {
            camera: _shape(features[image_key(camera)], folder)
            for camera in CAMERA_NAMES
            if image_key(camera) in features
        }
        if len(set(shapes.values())) > 1:
            raise BimanualError(
                f"{folder} reads images of several sizes ({shapes}), which no environment gives"
            )
        size = next((f"{height}x{width}" for height, width in shapes.values()), None)
        return cls(folder, policy, tuple(shapes), size, sha256(folder / WEIGHTS_FILE))

    @property
    def options(self) -> dict[str, Any]:
        """Options of an environment that shows the policy's inputs, and no more."""
        if self.image_size is None:
            return {"obs": "state"}
        return {"cameras": ",".join(self.cameras), "image_size": self.image_size}


def _shape(feature: Any, folder: Path) -> tuple[int, int]:
    """Height and width of an image."""
    shape = feature.get("shape") if isinstance(feature, dict) else None
    if not (isinstance(shape, list) and len(shape) == 3 and all(type(side) is int for side in shape)):
        raise BimanualError(
            f"{folder / CONFIG_FILE} gives an image the shape {shape!r}, but it must be three sides"
        )
    return shape[1], shape[2]
