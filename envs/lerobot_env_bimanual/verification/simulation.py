"""Checks of an episode against the simulation: its expert plays it again, and every column is compared."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.dataset.views import row_columns, rows_of_view
from lerobot_bimanual.episode import Episode, EpisodeMeta
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.verification.fault import Fault, first_of

REPLAY, KEYPOSES, ACTIONS, OBSERVATIONS = (
    "replay",
    "replayed keyposes",
    "replayed actions",
    "replayed observations",
)

COMPARED: dict[str, str] = {
    schema.STATE_HASH: REPLAY,
    schema.TASK_NAME: REPLAY,
    schema.SPLIT: REPLAY,
    schema.VARIATION: REPLAY,
    schema.SEED: REPLAY,
    schema.TICK: REPLAY,
    schema.NEXT_KEYPOSE: KEYPOSES,
    schema.KEYFRAME: KEYPOSES,
    schema.ACTION: ACTIONS,
    schema.STATE: OBSERVATIONS,
    schema.EE_POSE: OBSERVATIONS,
    schema.GRIPPER_FINGERS: OBSERVATIONS,
    schema.KEYPOSE_STEP: OBSERVATIONS,
    schema.CAMERA_EXTRINSICS: OBSERVATIONS,
    schema.CAMERA_INTRINSICS: OBSERVATIONS,
}
"""Column -> check that compares it bit for bit; all of the schema's."""


class Player:
    """Plays episodes of datasets again, as they were recorded; keeps the last one, and its world for the next.

    An episode is recorded once more, from its seed, by the expert. Where its keyposes, joint actions and states are
    those of the dataset, the dataset's keyposes and joint actions lead to the dataset's states: the simulation is given
    the same numbers. So one play answers for both kinds of replay, and for both views of an episode.
    """

    def __init__(self):
        self._recorder: Recorder | None = None
        self._world: tuple[Any, ...] = ()
        self._last: tuple[tuple[Any, ...], Episode] | None = None

    def play(self, dataset: RecordedDataset, meta: EpisodeMeta, image_size: tuple[int, int]) -> Episode:
        """The episode, recorded again; its images can be asked for until another one is played.

        Args:
            dataset: whose cameras and rounding of keyposes are taken.
            meta: which episode.
            image_size: (height, width) of new images in pixels.

        Raises:
            BimanualError: it cannot be played, or is not solved.
        """
        voxels, perturb = setting(dataset, "discretise", 0), setting(dataset, "perturb", "")
        world = meta.task, meta.split, dataset.cameras, image_size, voxels, perturb
        which = *world, meta.variation, meta.seed
        if self._last is None or self._last[0] != which:
            outcome, episode = self._recorder_of(world).record(meta.seed, meta.variation)
            if episode is None:
                raise DatasetError(
                    f"the expert does not solve it: {outcome.failure}, at {outcome.last_move!r}"
                )
            self._last = which, episode
        return self._last[1]

    def close(self) -> None:
        """Free the world and its images."""
        if self._recorder is not None:
            self._recorder.close()
        self._recorder = self._last = None

    def _recorder_of(self, world: tuple[Any, ...]) -> Recorder:
        if self._recorder is None or self._world != world:
            self.close()
            task, split, cameras, image_size, voxels, perturb = world
            codec = KeyposeCodec(voxels=voxels) if voxels else None
            self._recorder = Recorder(task, split, cameras, image_size, codec, perturb)
            self._world = world
        self._last = None  # its images are lost now
        return self._recorder


def compare_columns(
    dataset: RecordedDataset, stored: RecordedEpisode, played: Episode
) -> dict[str, tuple[Fault, ...]]:
    """Faults of the columns of an episode by check.

    Args:
        dataset: whose rows are chosen as its settings say.
        stored: an episode of it.
        played: the same episode, played again.
    """
    found: dict[str, list[Fault]] = {check: [] for check in COMPARED.values()}
    if stored.meta.instruction != played.meta.instruction:
        found[REPLAY].append(
            Fault(f"is told {stored.meta.instruction!r}, but its seed says {played.meta.instruction!r}")
        )
    ticks = stored.columns[schema.TICK]
    intermediate = tuple(setting(dataset, "intermediate", ()))
    expected = np.array(rows_of_view(played, dataset.view, intermediate))
    if not np.array_equal(ticks, expected):
        found[REPLAY].append(Fault(f"holds the ticks {_short(ticks)}, but the replay {_short(expected)}"))
    rows = [row for row, tick in enumerate(ticks) if tick in expected]
    wanted = [row_columns(played, int(ticks[row]), dataset.view) for row in rows]
    for key, check in COMPARED.items():
        found[check].extend(_first_difference(key, stored, rows, [columns[key] for columns in wanted]))
    return {check: tuple(faults) for check, faults in found.items()}


def setting(dataset: RecordedDataset, name: str, otherwise: Any) -> Any:
    """What a dataset says that it was made with, or something else where it says nothing."""
    return otherwise if dataset.provenance is None else dataset.provenance.settings.get(name, otherwise)


def _first_difference(
    key: str, stored: RecordedEpisode, rows: list[int], wanted: list[Any]
) -> Iterator[Fault]:
    """The first row in which a column differs from the replay's."""
    if rows:
        expected = np.stack([np.squeeze(value) for value in wanted])
        found = stored.columns[key][rows]
        differs = np.zeros(len(stored), bool)
        differs[rows] = (found != expected).reshape(len(rows), -1).any(axis=1)
        yield from first_of(differs, f"{key} is not what the simulation says")


def _short(ticks: np.ndarray) -> str:
    return np.array2string(ticks, threshold=12, edgeitems=5, separator=" ")
