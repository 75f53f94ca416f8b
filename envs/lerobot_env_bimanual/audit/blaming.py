"""Who lost many episodes, found out on several cores."""

from __future__ import annotations

from collections.abc import Sequence

from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.audit.blame import Blame, Blamer
from lerobot_env_bimanual.workers import WorkerPool

type Options = tuple[tuple[str, str | int], ...]


def blames_of(record: EvaluationRecord, episodes: Sequence[Episode], pool: WorkerPool) -> list[Blame]:
    """Why each of some failed episodes of an evaluation failed, with a progress bar.

    Raises:
        BimanualError: one does not come out as recorded.
    """
    options = tuple(sorted(record.options.items()))
    jobs = [(record.task, options, episode) for episode in episodes]
    return list(pool.map(_blame, jobs, f"{record.task}: why it failed", "episode", name=_name))


def _name(job: tuple[str, Options, Episode]) -> str:
    return f"{job[0]}, seed {job[2].seed}"


_blamers: dict[tuple[str, Options], Blamer] = {}


def _blame(job: tuple[str, Options, Episode]) -> Blame:
    """Look at one episode in this process, in an environment that is kept for the next one of its kind."""
    task, options, episode = job
    if (task, options) not in _blamers:
        for blamer in _blamers.values():
            blamer.close()
        _blamers.clear()
        _blamers[task, options] = Blamer(task, dict(options))
    return _blamers[task, options].blame(episode)
