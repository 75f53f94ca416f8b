"""The environment's options: one dataclass for Gymnasium's keywords, LeRobot's command lines and our commands.

Also the checks of what `reset` is given.
"""

import difflib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, Self, get_args

import numpy as np

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.registry import checked_perturbation

ANY_VARIATION = "any"

SPLITS = {"train": 0, "val": 1, "test": 2}
"""Number of each split in an episode's seed sequence, so that one integer means three different episodes."""

SETTINGS = {"standard": 0, "varied": 1}
"""Number of each setting in an episode's seed sequence."""
STANDARD, VARIED = SETTINGS

ObservationMode = Literal["rgbd", "rgb", "state"]
ControlMode = Literal["auto", "joint", "keypose"]
RenderQuality = Literal["observation", "high"]

MIN_IMAGE_SIDE, MAX_IMAGE_SIDE = 8, 4096

MAX_SEED = 2**63 - 1
"""The largest that a dataset's column can hold."""


@dataclass
class EnvOptions:
    """Options of one environment besides its task, valid by construction.

    The types are those that LeRobot's command lines can read; Python may also give `cameras` as a sequence,
    `image_size` as `(height, width)` and folders as paths.

    Raises:
        InvalidChoice: an option is outside its choices.
    """

    # Index of the variation of every episode, or `any` to draw one per episode.
    variation: int | str = ANY_VARIATION
    # `train`, `val` or `test`: the same seed means different episodes in each. Datasets are generated from `train`, so
    # an evaluation with the default never sees a demonstrated episode.
    split: str = "test"
    # `standard` has the paper's things; in `varied` their sizes, heights and places differ from episode to episode, too.
    setting: str = STANDARD
    # Cameras of the observation, separated by commas.
    cameras: str = ",".join(CAMERA_NAMES)
    # Side of the images in pixels, or height and width as in `480x640`.
    image_size: int | str = 256
    # `rgbd`, `rgb` (no depth) or `state` (no images).
    obs: str = "rgbd"
    # `joint` and `keypose` take one kind of action and are strict. `auto` declares joint actions and executes joint
    # actions and keyposes alike, told apart by their length: LeRobot sizes a policy's output by the declared action,
    # and this way ACT and keypose policies run with the same command.
    control_mode: str = "auto"
    # Perturbations of the nominal world, as `AXIS:LEVEL` with levels 1 to 3, several separated by commas. The seed
    # means the same episode at every level; docs/robustness.md lists the axes.
    perturb: str = ""
    # Folder for a video of every episode's whole motion. (LeRobot's own videos hold one frame per step, which is one
    # per keypose.)
    video_dir: str | None = None
    # Folder for a record of every episode that a vector environment plays: outcome, actions and a chain of state hashes,
    # from which `lerobot-bimanual results verify` plays it again without the policy. One file per task. Each episode is on
    # the disk when it ends; the same evaluation continues where it stopped, and another one is refused.
    results_dir: str | None = None
    # Whether an episode ends as a failure when an arm presses with more than 100 N for 0.1 s, as a real one stops; push_box
    # needs 250 N.
    protective_stop: bool = False
    # Keyposes until an episode is truncated; RLBench's evaluation in PerAct2 allows as many as the default.
    max_keyposes: int = 25
    # Quality of `render` and of videos: `observation` or `high`. On one CPU core a frame costs 25 ms or 300
    # ms, so `high`, with shadows and anti-aliasing, is for pictures of a few episodes.
    render_quality: str = "observation"

    def __post_init__(self) -> None:
        """Bring every option into its canonical form, and refuse values outside its choices."""
        self.cameras = ",".join(_camera_names(self.cameras))
        self.perturb = checked_perturbation(self.perturb)
        height, width = _image_size(self.image_size)
        self.image_size = height if height == width else f"{height}x{width}"
        for name in ("video_dir", "results_dir"):
            if (folder := getattr(self, name)) is not None:
                setattr(self, name, _writable_folder(name, folder))
        for option, choices in (
            ("split", tuple(SPLITS)),
            ("setting", tuple(SETTINGS)),
            ("obs", get_args(ObservationMode)),
            ("control_mode", get_args(ControlMode)),
            ("render_quality", get_args(RenderQuality)),
        ):
            value = getattr(self, option)
            if not isinstance(value, str) or value not in choices:
                raise InvalidChoice(option, value, choices)
        if type(self.protective_stop) is not bool:
            raise InvalidChoice("protective_stop", self.protective_stop, ("true", "false"))
        if type(self.max_keyposes) is not int or self.max_keyposes < 1:
            raise InvalidChoice("max_keyposes", self.max_keyposes, "an integer of at least 1")

    @classmethod
    def of(cls, **keywords: Any) -> Self:
        """The options that keywords give.

        Raises:
            InvalidChoice: a keyword is no option.
        """
        names = [field.name for field in fields(EnvOptions)]
        for name in keywords:
            if name not in names:
                raise InvalidChoice("an option of the environment", name, names)
        return cls(**keywords)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Cameras of the observation, in order."""
        return tuple(self.cameras.split(","))

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the images in pixels."""
        return _image_size(self.image_size)

    def keywords(self) -> dict[str, Any]:
        """These options by name, as `BimanualEnv` takes them."""
        return {field.name: getattr(self, field.name) for field in fields(EnvOptions)}


def checked_seed(seed: Any) -> int | None:
    """A seed as a plain integer, or `None`.

    Raises:
        InvalidChoice: it is neither an integer from 0 to `MAX_SEED` nor `None`.
    """
    if seed is None:
        return None
    is_integer = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not is_integer or not 0 <= int(seed) <= MAX_SEED:
        raise InvalidChoice("seed", seed, "None or an integer from 0 to 2**63 - 1")
    return int(seed)


def checked_reset_options(options: Any) -> Mapping[str, Any]:
    """The options of a reset; those of other callers, such as LeRobot's, are let through.

    Raises:
        InvalidChoice: they are no mapping, or one of them looks like `variation` misspelt.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InvalidChoice("options", options, ["None", "a mapping such as {'variation': 0}"])
    for name in options:
        if name != "variation" and difflib.get_close_matches(str(name).lower(), ["variation"], cutoff=0.8):
            raise InvalidChoice("an option of reset", name, ["variation"])
    return options


def _camera_names(cameras: Any) -> tuple[str, ...]:
    names = cameras.split(",") if isinstance(cameras, str) else cameras
    is_list = isinstance(names, Sequence) and all(isinstance(name, str) for name in names)
    chosen = tuple(name.strip() for name in names) if is_list else ()
    if not chosen or len({*chosen}) < len(chosen):
        raise InvalidChoice("cameras", cameras, f"a non-empty list of {', '.join(CAMERA_NAMES)}, none twice")
    for name in chosen:
        if name not in CAMERA_NAMES:
            raise InvalidChoice("cameras", name, CAMERA_NAMES)
    return chosen


def _image_size(image_size: object) -> tuple[int, int]:
    sides = image_size if isinstance(image_size, tuple | list) else [image_size]
    found = re.fullmatch("([0-9]{1,4})(?:x([0-9]{1,4}))?", "x".join(map(str, sides)), re.ASCII)
    height, width = (0, 0) if found is None else (int(found[1]), int(found[2] or found[1]))
    if not all(MIN_IMAGE_SIDE <= side <= MAX_IMAGE_SIDE for side in (height, width)):
        choices = f"{MIN_IMAGE_SIDE} to {MAX_IMAGE_SIDE} pixels, or HEIGHTxWIDTH such as 480x640"
        raise InvalidChoice("image_size", image_size, choices)
    return height, width


def _writable_folder(option: str, path: object) -> str:
    """The path of a folder that can be written or made."""
    if not isinstance(path, str | Path):
        raise InvalidChoice(option, path, "the path of a folder")
    try:
        folder = Path(path).absolute()
        there = next(place for place in (folder, *folder.parents) if place.exists())
        is_writable = there.is_dir() and os.access(there, os.W_OK | os.X_OK) and "\0" not in str(path)
    except OSError:  # a name that is too long
        is_writable = False
    if not is_writable:
        raise InvalidChoice(option, str(path), "the path of a folder that can be written or made")
    return str(path)
