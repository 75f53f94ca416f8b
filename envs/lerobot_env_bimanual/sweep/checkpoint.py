"""Checkpoints: whether one may be loaded, and the images that it reads, known before LeRobot and torch are imported."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.checkpoint_folder import CONFIG_FILE, require_checkpoint
from lerobot_bimanual.dataset.schema import image_key
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import sha256
from lerobot_bimanual.results.record import Record

WEIGHTS_FILE = "model.safetensors"
CHECKER = "policy check"
"""The command whose module has a function `require_safe`."""


class _Feature(Record, extra="ignore"):
    shape: tuple[int, ...]


class _Config(Record, extra="ignore"):
    """Part of a policy's `config.json`."""

    type: str
    input_features: dict[str, _Feature]


@dataclass(frozen=True)
class Checkpoint:
    """A folder `pretrained_model` as LeRobot leaves it.

    Attributes:
        folder: path of the folder.
        policy: type of the policy.
        options: of an environment that shows the policy's inputs, and no more.
        sha256: of its weights.
    """

    folder: Path
    policy: str
    options: dict[str, Any]
    sha256: str

    @classmethod
    def read(cls, folder: Path) -> Self:
        """The checkpoint in a folder.

        Raises:
            BimanualError: there is none, or its config is damaged.
        """
        require_checkpoint(folder)
        if not (folder / WEIGHTS_FILE).is_file():
            raise BimanualError(
                f"{folder / WEIGHTS_FILE} does not exist: the checkpoint is incomplete, or an adapter"
            )
        config = _Config.read(folder / CONFIG_FILE)
        cameras = [camera for camera in CAMERA_NAMES if image_key(camera) in config.input_features]
        sizes = {"x".join(map(str, config.input_features[image_key(name)].shape[1:])) for name in cameras}
        if len(sizes) > 1:
            raise BimanualError(
                f"{folder} reads images of the sizes {', '.join(sorted(sizes))}, but an environment gives one size"
            )
        options = {"cameras": ",".join(cameras), "image_size": sizes.pop()} if sizes else {"obs": "state"}
        return cls(folder, config.type, options, sha256(folder / WEIGHTS_FILE))


def require_safe(folder: Path) -> None:
    """Refuse a checkpoint that LeRobot's loader should not be given.

    Raises:
        BimanualError: it is damaged, may run a program of its own, or nothing that is installed can tell.
    """
    checker = entries("lerobot_bimanual.commands").get(CHECKER)
    if checker is None:
        raise BimanualError(
            f"cannot check whether {folder} runs a program of its own: install lerobot_policy_bimanual, or, if you trust its "
            "source, give --trust_checkpoint=true"
        )
    importlib.import_module(checker.module).require_safe(folder)
