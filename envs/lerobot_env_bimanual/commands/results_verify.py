"""The verb `verify-results`: proof that results are what their actions lead to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import check_range

if TYPE_CHECKING:
    from lerobot_bimanual.results.benchmark import BenchmarkResult
    from lerobot_bimanual.results.episode import Episode
    from lerobot_bimanual.results.evaluation import EvaluationRecord
    from lerobot_env_bimanual.audit.episodes import EpisodeAudit, EpisodeAuditor
    from lerobot_env_bimanual.sweep.evaluator import Evaluator

type Options = tuple[tuple[str, str | int], ...]


@dataclass
class ResultsVerifyConfig:
    """Options of the verb `verify-results`."""

    # A file, or a folder of files: rows of `benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    sample: int = 0  # episodes played again of each result, drawn at random; 0 plays all
    controls: int = 3  # seeds on which expert and blind are played anew, of each row; 0 plays none
    seed: int = 0  # of the draws
    workers: int = 0  # processes; 0 takes one per core


def results_verify(config: ResultsVerifyConfig) -> int:
    """Play the episodes of results again, without the policy, and compare every claim.

    From each seed the recorded actions are played: the state after every one of them must be the recorded one, bit for
    bit, and instruction, outcome, first tick of success, failure, ticks and keyposes must come out as claimed. Of a row
    of `benchmark`, no tested episode may start as a demonstration did, and on a few seeds the expert and the blind
    control are played anew. Exits with 1 if anything differs, and says where first.

    Examples:
        lerobot-bimanual results verify --results=results/leaderboard
        lerobot-bimanual results verify --results=outputs/eval/lift_ball_test_record.json
        lerobot-bimanual results verify --results=results/leaderboard --sample=5 --controls=1
    """
    from lerobot_env_bimanual.audit.result_files import result_files
    from lerobot_env_bimanual.sweep.evaluator import Evaluator

    for name in ("sample", "controls"):
        check_range(name, getattr(config, name), 0)
    check_range("seed", config.seed, 0)
    is_sound = True
    with Evaluator(config.workers) as campaign:
        for path in result_files(config.results):
            problems = list(_problems(path, config, campaign))
            print(f"{path}: {'as claimed' if not problems else 'NOT as claimed'}")
            for problem in problems:
                print(f"  {problem}")
            is_sound &= not problems
    return 0 if is_sound else 1


def _problems(path: Path, config: ResultsVerifyConfig, campaign: Evaluator) -> Iterator[str]:
    import numpy as np

    from lerobot_env_bimanual.audit.controls import control_problems
    from lerobot_env_bimanual.audit.result_files import Result, drawn

    result = Result.read(path)
    record, row = result.record, result.row
    if result.problem_of_world is not None:
        yield result.problem_of_world
    rng = np.random.default_rng(config.seed)
    episodes = drawn(record.episodes, config.sample, rng)
    audits = _audits(record, episodes, campaign)
    for audit in audits:
        yield from (f"seed {audit.seed}: {problem}" for problem in audit.problems)
    if row is not None:
        yield from _demonstrated(row, audits)
        seeds = [episode.seed for episode in drawn(record.episodes, config.controls, rng)]
        if config.controls:
            yield from control_problems(row, campaign, seeds)


def _audits(record: EvaluationRecord, episodes: list[Episode], campaign: Evaluator) -> list[EpisodeAudit]:
    from lerobot_env_bimanual.audit.episodes import EpisodeAudit

    options = tuple(sorted(record.options.items()))
    jobs = [(record.task, options, episode) for episode in episodes]
    return list(
        campaign.map(
            _audit,
            jobs,
            f"{record.task}: played again",
            "episode",
            failed=lambda job, reason: EpisodeAudit(job[2].seed, (f"not played: {reason}",), ""),
        )
    )


def _demonstrated(row: BenchmarkResult, audits: list[EpisodeAudit]) -> Iterator[str]:
    from lerobot_env_bimanual.audit.controls import demonstrated_placements
    from lerobot_env_bimanual.tasks.registry import resolve_tasks

    if row.config.trained_on and row.task not in resolve_tasks(row.config.trained_on):
        yield f"it was trained on {row.config.trained_on}, of which {row.task} is none, and so on none of the demonstrations it names"
    placements = demonstrated_placements(row)
    for audit in audits:
        if audit.placement in placements:
            yield f"seed {audit.seed}: starts as the demonstration of seed {placements[audit.placement]} does"


_auditors: dict[tuple[str, Options], EpisodeAuditor] = {}


def _audit(job: tuple[str, Options, Episode]) -> EpisodeAudit:
    """Play one episode in this process, in an environment that is kept for the next one of its kind."""
    from lerobot_env_bimanual.audit.episodes import EpisodeAuditor

    task, options, episode = job
    if (task, options) not in _auditors:
        for auditor in _auditors.values():
            auditor.close()
        _auditors.clear()
        _auditors[task, options] = EpisodeAuditor(task, dict(options))
    return _auditors[task, options].audit(episode)
