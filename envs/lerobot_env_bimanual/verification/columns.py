"""Plays an episode of a dataset again, by its expert, and compares every column of it."""

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.provenance import EpisodeKey
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.dataset.schema import PROVENANCE_FILE
from lerobot_bimanual.dataset.views import row_columns, rows_of_view
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.experts.recorder import Recorder, recording_options
from lerobot_env_bimanual.verification.fault import Fault


class Player:
    """Plays episodes of datasets again, as they were recorded; keeps the last one.

    The expert plays an episode once more, from its seed. If its keyposes, joint actions and states equal those of the
    dataset, the dataset's keyposes and joint actions lead to the dataset's states, as the simulation is given the same
    numbers. So one play verifies both kinds of replay, and both views of an episode. (Under `misses`, which ends with a
    keypose, a replay by joint actions goes through other states; under `command_noise` some hashes differ.)
    """

    def __init__(self):
        self._recorder = Recorder()
        self._last: tuple[object, Demonstration] | None = None

    def play(
        self, dataset: RecordedDataset, stored: RecordedEpisode, image_size: tuple[int, int]
    ) -> Demonstration:
        """An episode, recorded again, with images of `image_size` (height, width) until another one is played.

        Raises:
            BimanualError: it cannot be played, or is not solved.
        """
        meta, plans = stored.meta, stored.columns.get(feature_table.PLAN)
        made = dataset.provenance
        assert made is not None  # otherwise nothing is played again
        options = recording_options(meta.split, dataset.cameras, image_size, made.perturb, made.setting)
        voxels = made.settings.get("discretise", 0)
        plan = None if plans is None else int(plans[0])
        which = meta.task, options, meta.seed, meta.variation, voxels, plan
        if self._last is None or self._last[0] != which:
            self._last = None  # its images are lost now
            outcome, episode = self._recorder.record(*which)
            if episode is None:
                raise DatasetError(
                    f"the expert does not solve it: {outcome.failure}, at {outcome.last_move!r}"
                )
            self._last = which, episode
        return self._last[1]


def check_replay(dataset: RecordedDataset, stored: RecordedEpisode, played: Demonstration) -> Iterator[Fault]:
    """Faults: where an episode's columns differ, in any bit, from those of the same episode played again."""
    if stored.meta.instruction != played.meta.instruction:
        yield Fault(f"the instruction is {stored.meta.instruction!r}, not {played.meta.instruction!r}")
    if (made := dataset.provenance) is not None:
        meta, plans = stored.meta, stored.columns.get(feature_table.PLAN, (0,))
        key = EpisodeKey(
            task=meta.task, variation=meta.variation, split=meta.split, seed=meta.seed, plan=int(plans[0])
        )
        if made.episodes[stored.index : stored.index + 1] != (key,):
            yield Fault(f"{PROVENANCE_FILE} names another episode at {stored.index} than {key}")
    ticks = stored.columns[schema.TICK]
    settings = {} if dataset.provenance is None else dataset.provenance.settings
    expected = np.array(rows_of_view(played, dataset.view, settings.get("intermediate", ())))
    if not np.array_equal(ticks, expected):
        yield Fault(f"the ticks are {_short(ticks)}, not {_short(expected)}")
    rows = [row for row, tick in enumerate(ticks) if tick in expected]
    expected_columns = [row_columns(played, int(ticks[row]), dataset.view) for row in rows]
    if dataset.calibration is not None:
        expected_columns = [
            dataset.calibration.row_without_calibration(columns) for columns in expected_columns
        ]
    for key in stored.columns if rows else ():
        values = np.stack([np.squeeze(columns[key]) for columns in expected_columns])
        differs = np.zeros(len(stored), bool)
        differs[rows] = (stored.columns[key][rows] != values).reshape(len(rows), -1).any(axis=1)
        if wrong := np.flatnonzero(differs).tolist():
            more = f" (and {len(wrong) - 1} more rows)" if len(wrong) > 1 else ""
            yield Fault(f"{key} is not what the simulation gives{more}", wrong[0])


def _short(ticks: np.ndarray) -> str:
    return np.array2string(ticks, threshold=12, edgeitems=5, separator=" ")
