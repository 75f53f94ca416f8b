"""Checkpoints: the images that a trained policy reads, known before LeRobot and torch are imported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from pydantic import ConfigDict

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.checksums import sha256
from lerobot_bimanual.dataset.schema import image_key
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.record import Record

CONFIG_FILE, WEIGHTS_FILE = "config.json", "model.safetensors"


class _Feature(Record):
    model_config = ConfigDict(extra="ignore")

    shape: tuple[int, ...]


class _Config(Record):
    """Part of a policy's `config.json`."""

    model_config = ConfigDict(extra="ignore")

    type: str
    input_features: dict[str, _Feature]


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
        config = _Config.read(folder / CONFIG_FILE)
        cameras = tuple(camera for camera in CAMERA_NAMES if image_key(camera) in config.input_features)
        sizes = {config.input_features[image_key(camera)].shape[1:] for camera in cameras}
        if len(sizes) > 1 or any(len(size) != 2 for size in sizes):
            raise BimanualError(
                f"{folder} reads images of the sizes {sizes}, but an environment gives one size"
            )
        size = next((f"{height}x{width}" for height, width in sizes), None)
        return cls(folder, config.type, cameras, size, sha256(folder / WEIGHTS_FILE))

    @property
    def options(self) -> dict[str, Any]:
        """Options of an environment that shows the policy's inputs, and no more."""
        if self.image_size is None:
            return {"obs": "state"}
        return {"cameras": ",".join(self.cameras), "image_size": self.image_size}
