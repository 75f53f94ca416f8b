"""The environment's options, read from Python or command-line values and checked in one place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self, get_args

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import InvalidChoice, UnknownCamera, UnknownVariation
from lerobot_env_bimanual.task import TaskSpec

ANY_VARIATION = "any"
SPLITS = {"train": 0, "val": 1, "test": 2}
"""Number of each split in an episode's seed sequence, so that one integer means three different episodes."""

ObservationMode = Literal["rgbd", "rgb", "state"]
ControlMode = Literal["auto", "joint", "keypose"]
RenderQuality = Literal["observation", "high"]

MAX_KEYPOSES = 25
"""Keyposes per episode until it is truncated (RLBench's evaluation in PerAct2 allows as many)."""

MIN_IMAGE_SIDE = 8


@dataclass(frozen=True)
class EnvOptions:
    """Options of one `BimanualEnv`, valid by construction.

    Attributes:
        variation: index of the variation of every episode, or `None` to draw one per episode.
        split: "train", "val" or "test".
        cameras: cameras of the observation, in order.
        height: image height in pixels.
        width: image width in pixels.
        obs: "rgbd", "rgb" (no depth) or "state" (no images).
        control_mode: "auto", "joint" or "keypose".
        video_dir: where each episode's motion is filmed, or `None`.
        max_keyposes: keyposes until an episode is truncated.
        render_quality: "observation" or "high", of rendered frames and films.
    """

    variation: int | None
    split: str
    cameras: tuple[str, ...]
    height: int
    width: int
    obs: ObservationMode
    control_mode: ControlMode
    video_dir: Path | None
    max_keyposes: int
    render_quality: RenderQuality

    @classmethod
    def parse(
        cls,
        spec: TaskSpec,
        *,
        variation: int | str,
        split: str,
        cameras: str | Sequence[str],
        image_size: int | str | Sequence[int],
        obs: str,
        control_mode: str,
        video_dir: str | Path | None,
        max_keyposes: int,
        render_quality: str,
    ) -> Self:
        """Read the options of a task's environment.

        Args:
            spec: the task.
            variation: index, or "any".
            split: key of `SPLITS`.
            cameras: names, as a sequence or separated by commas.
            image_size: side of a square image, `(height, width)`, or the text "256" or "480x640".
            obs: an `ObservationMode`.
            control_mode: a `ControlMode`.
            video_dir: folder, created when the first video is written.
            max_keyposes: at least 1.
            render_quality: a `RenderQuality`.

        Raises:
            UnknownVariation: the task has no such variation.
            UnknownCamera: the scene has no such camera.
            InvalidChoice: another option is outside its choices.
        """
        height, width = _parse_image_size(image_size)
        if max_keyposes < 1:
            raise InvalidChoice("max_keyposes", max_keyposes, ["an integer of at least 1"])
        return cls(
            variation=_parse_variation(spec, variation),
            split=_one_of("split", split, tuple(SPLITS)),
            cameras=_parse_cameras(cameras),
            height=height,
            width=width,
            obs=_one_of("obs", obs, get_args(ObservationMode)),
            control_mode=_one_of("control_mode", control_mode, get_args(ControlMode)),
            video_dir=None if video_dir is None else Path(video_dir),
            max_keyposes=max_keyposes,
            render_quality=_one_of("render_quality", render_quality, get_args(RenderQuality)),
        )


def _one_of[T](option: str, value: object, choices: tuple[T, ...]) -> T:
    for choice in choices:
        if value == choice:
            return choice
    raise InvalidChoice(option, value, map(str, choices))


def _parse_variation(spec: TaskSpec, variation: int | str) -> int | None:
    if variation == ANY_VARIATION:
        return None
    try:
        index = int(variation)
    except ValueError:
        index = -1
    if not 0 <= index < len(spec.variations):
        raise UnknownVariation(spec.name, variation, len(spec.variations))
    return index


def _parse_cameras(cameras: str | Sequence[str]) -> tuple[str, ...]:
    names = cameras.split(",") if isinstance(cameras, str) else cameras
    chosen = tuple(dict.fromkeys(name.strip() for name in names))
    if not chosen:
        raise InvalidChoice("cameras", cameras, ["a non-empty list of " + ", ".join(CAMERA_NAMES)])
    for name in chosen:
        if name not in CAMERA_NAMES:
            raise UnknownCamera(name, CAMERA_NAMES)
    return chosen


def _parse_image_size(image_size: int | str | Sequence[int]) -> tuple[int, int]:
    sides = image_size.split("x") if isinstance(image_size, str) else image_size
    if isinstance(sides, int):
        sides = (sides,)
    try:
        height, width = int(sides[0]), int(sides[-1])
    except (ValueError, IndexError, TypeError):
        height = width = 0
    if len(sides) > 2 or min(height, width) < MIN_IMAGE_SIDE:
        valid = f"a side of at least {MIN_IMAGE_SIDE} pixels (256), (height, width), the text '480x640'"
        raise InvalidChoice("image_size", image_size, [valid])
    return height, width
