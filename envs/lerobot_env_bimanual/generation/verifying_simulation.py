"""Checks of an episode against the simulation: it is played again, and what was stored is compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import PIXELS, env_key, observe_images
from lerobot_env_bimanual.generation.faults import Fault
from lerobot_env_bimanual.generation.replaying import Replayer, ReplayMode, ReplayResult
from lerobot_env_bimanual.generation.verifying_video import VideoComparison
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
        self._dataset = dataset
        self._reader = reader
        self.is_video = dataset.view == "frames"
        self._modes: tuple[ReplayMode, ...] = ("joint", "keypose") if self.is_video else ("keypose",)
        self._replayers = {mode: Replayer(dataset.root, mode, (height, width)) for mode in self._modes}
        self._size = height, width
        self._renderer: Renderer | None = None
        self._rendered_env: BimanualEnv | None = None

    def run(self, episode: RecordedEpisode, render: bool) -> dict[str, tuple[Fault, ...]]:
        """Faults of one episode by check; with `render` its images are compared too."""
        comparison = _Comparison(self, episode, render)
        faults = {STATES: comparison.play(self._replayers[self._modes[0]])}
        if self.is_video:
            faults[KEYPOSES] = _play(self._replayers["keypose"], episode.index)
        return faults | comparison.faults

    def new_images(self, env: BimanualEnv) -> dict[str, NDArray]:
        """Images of the present state as the dataset would store them: key -> RGB, or depth in whole mm."""
        cameras = self._dataset.cameras
        if self._renderer is None or self._rendered_env is not env:
            if self._renderer is not None:
                self._renderer.close()
            self._renderer = Renderer(env.scene, cameras, *self._size)
            self._rendered_env = env
        options = replace(env.options, obs="rgbd", cameras=",".join(cameras))
        observation = observe_images(options, self._renderer.render())
        images = {}
        for camera in cameras:
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
    """One episode beside its record; at the first state that differs it stops looking."""

    def __init__(self, checks: SimulationChecks, episode: RecordedEpisode, render: bool):
        self._checks = checks
        self._episode = episode
        self._rows = {int(tick): row for row, tick in enumerate(episode.columns[schema.TICK])}
        self._images = checks.stored_images(episode.index) if render else None
        self._videos = checks.video_comparisons() if render else {}
        self._diverged: Fault | None = None
        names = (OBSERVATIONS, RGB, DEPTH) if render else (OBSERVATIONS,)
        self._found: dict[str, list[Fault]] = {name: [] for name in names}

    @property
    def faults(self) -> dict[str, tuple[Fault, ...]]:
        """What differs from the simulated episode, by check; of each check the first fault only."""
        return {name: tuple(found[:1]) for name, found in self._found.items()}

    def play(self, replayer: Replayer) -> tuple[Fault, ...]:
        """Play the episode and compare; returns the faults of the states."""
        faults = _play(replayer, self._episode.index, self._visit)
        if self._videos:  # first, as it explains what is wrong with single frames
            self._found[RGB][:0] = [fault for video in self._videos.values() for fault in video.faults()]
        return (self._diverged,) if self._diverged is not None else faults

    def _visit(self, env: BimanualEnv) -> None:
        if self._diverged is not None:
            return
        tick = env.progress.ticks
        ended = self._rows.get(tick - 1)
        if ended is not None:
            recorded = self._episode.columns[schema.STATE_HASH][ended]
            if schema.state_hash_column(env.state_hash()) != recorded:
                self._diverged = Fault(f"the simulation is in another state after tick {tick - 1}", ended)
                return
        row = self._rows.get(tick)
        if row is not None:
            self._compare_row(env, row)

    def _compare_row(self, env: BimanualEnv, row: int) -> None:
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


def _play(replayer: Replayer, index: int, visit=None) -> tuple[Fault, ...]:
    try:
        result = replayer.replay(index, visit)
    except BimanualError as error:
        return (Fault(f"cannot be played: {error}"),)
    return _replay_faults(result)


def _replay_faults(result: ReplayResult) -> tuple[Fault, ...]:
    faults = []
    if result.divergence is not None:
        faults.append(Fault(f"the simulation is in another state after tick {result.divergence}"))
    if not result.success:
        faults.append(Fault(f"is not solved: {result.failure or 'conditions unmet'}"))
    return tuple(faults)
