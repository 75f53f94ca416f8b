"""Checks of an episode against the simulation: it is played again, and what was stored is compared."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import PIXELS, env_key, observe_images
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.replay import ReplayMode, Visitor
from lerobot_env_bimanual.verification.fault import Fault
from lerobot_env_bimanual.verification.replayer import Replayer
from lerobot_env_bimanual.verification.video import VideoComparison
from lerobot_env_bimanual.world.rendering import Renderer

STATES, KEYPOSES, OBSERVATIONS = "replay", "keypose replay", "observations"
RGB, DEPTH = "rendered RGB", "rendered depth"

OBSERVED = (
    schema.STATE,
    schema.EE_POSE,
    schema.GRIPPER_FINGERS,
    schema.CAMERA_EXTRINSICS,
    schema.CAMERA_INTRINSICS,
)
"""Vectors that the simulated state alone decides."""


class SimulationChecks:
    """Plays episodes of one view again; keeps environment and renderer for the next one.

    Args:
        dataset: the view.
        reader: its images.
    """

    def __init__(self, dataset: RecordedDataset, reader: ImageReader):
        height, width, _ = next(iter(reader.shapes.values()))
        self.is_video = dataset.view == "frames"
        modes: tuple[ReplayMode, ...] = ("joint", "keypose") if self.is_video else ("keypose",)
        self._replayers = [Replayer(dataset.root, mode, (height, width)) for mode in modes]
        self._reader = reader
        self._options = EnvOptions(cameras=",".join(dataset.cameras), image_size=f"{height}x{width}")
        self._renderer: Renderer | None = None
        self._rendered_env: BimanualEnv | None = None

    def run(self, episode: RecordedEpisode, render: bool) -> dict[str, tuple[Fault, ...]]:
        """Faults of one episode by check; with `render` its images are compared too."""
        comparison = _Comparison(self, episode, render)
        first, *others = self._replayers
        faults = {STATES: self._play(first, episode, comparison.visit)}
        for replayer in others:
            faults[KEYPOSES] = self._play(replayer, episode)
        return faults | comparison.faults()

    def _play(
        self, replayer: Replayer, episode: RecordedEpisode, visit: Visitor | None = None
    ) -> tuple[Fault, ...]:
        try:
            _, result = replayer.replay(episode.index, visit)
        except BimanualError as error:
            return (Fault(f"cannot be played: {error}"),)
        if result.divergence is not None:
            row = _row_of(episode).get(result.divergence)
            return (Fault(f"the simulation is in {result.comparison}", row),)
        return () if result.success else (Fault(f"is not solved: {result.failure or 'conditions unmet'}"),)

    def new_images(self, env: BimanualEnv) -> dict[str, NDArray]:
        """Images of the present state as the dataset would store them: key -> RGB, or depth in whole mm."""
        options = self._options
        if self._renderer is None or self._rendered_env is not env:
            if self._renderer is not None:
                self._renderer.close()
            self._renderer = Renderer(env.scene, options.camera_names, *options.size)
            self._rendered_env = env
        observation = observe_images(options, self._renderer.render())
        images = {}
        for camera in options.camera_names:
            images[schema.image_key(camera)] = observation[PIXELS][camera]
            depth_mm = observation[env_key(schema.depth_key(camera))][0]
            images[schema.depth_key(camera)] = np.rint(depth_mm).astype(np.uint16)
        return images

    def stored_images(self, episode: int) -> Iterator[dict[str, NDArray]]:
        """The stored images row by row."""
        streams = {key: self._reader.images(episode, key) for key in self._reader.shapes}
        while True:
            try:
                yield {key: next(stream) for key, stream in streams.items()}
            except StopIteration:
                return

    def image_faults(
        self, stored: dict[str, NDArray], new: dict[str, NDArray], row: int
    ) -> Iterator[tuple[str, Fault]]:
        """(check, fault) of every image of a row that is not exactly the new one; of videos, depth alone."""
        for key, image in stored.items():
            if self._reader.is_depth(key):
                error_mm = np.abs(image.astype(np.int32) - new[key]).max()
                if error_mm > 0:
                    yield DEPTH, Fault(f"{key} is wrong by up to {error_mm} mm", row)
            elif not self.is_video and not np.array_equal(image, new[key]):
                pixels = (image != new[key]).any(axis=-1).sum()
                yield RGB, Fault(f"{key} differs from a new image in {pixels} pixels", row)

    def video_comparisons(self) -> dict[str, VideoComparison]:
        """A new comparison for every video of colours, by key."""
        keys = [key for key in self._reader.shapes if self.is_video and not self._reader.is_depth(key)]
        return {key: VideoComparison(key) for key in keys}


class _Comparison:
    """What an episode's rows show, beside what the simulation shows at the same ticks."""

    def __init__(self, checks: SimulationChecks, episode: RecordedEpisode, render: bool):
        self._checks = checks
        self._episode = episode
        self._rows = _row_of(episode)
        self._images = checks.stored_images(episode.index) if render else None
        self._videos = checks.video_comparisons() if render else {}
        names = (OBSERVATIONS, RGB, DEPTH) if render else (OBSERVATIONS,)
        self._found: dict[str, list[Fault]] = {name: [] for name in names}

    def faults(self) -> dict[str, tuple[Fault, ...]]:
        """What differs, by check, after the last tick; of each check the first fault only."""
        if self._videos:  # first, as it explains what is wrong with single frames
            self._found[RGB][:0] = [fault for video in self._videos.values() for fault in video.faults()]
        return {name: tuple(found[:1]) for name, found in self._found.items()}

    def visit(self, env: BimanualEnv) -> None:
        """Compare the row of the present tick, if there is one."""
        row = self._rows.get(env.progress.ticks)
        if row is None:
            return
        observation = env.observe()
        for key in OBSERVED:
            if not np.array_equal(observation[env_key(key)], self._episode.columns[key][row]):
                self._found[OBSERVATIONS].append(Fault(f"{key} is not what the simulation says", row))
        if self._images is not None:
            stored, new = next(self._images), self._checks.new_images(env)
            for check, fault in self._checks.image_faults(stored, new, row):
                self._found[check].append(fault)
            for key, video in self._videos.items():
                self._found[RGB].extend(video.frame_faults(stored[key], new[key], row))


def _row_of(episode: RecordedEpisode) -> dict[int, int]:
    """Control tick -> row."""
    return {int(tick): row for row, tick in enumerate(episode.columns[schema.TICK])}
