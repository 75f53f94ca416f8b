"""The sweep of the expert: it and the open-loop baseline in every condition of a task that changes what happens."""

from __future__ import annotations

from pathlib import Path

from lerobot_bimanual.results.robustness import (
    ExpertCondition,
    ExpertRobustnessConfig,
    ExpertRobustnessReport,
)
from lerobot_env_bimanual.options import ANY_VARIATION
from lerobot_env_bimanual.sweep.conditions import Conditions, extended, read_earlier, solved_seeds
from lerobot_env_bimanual.sweep.evaluator import EpisodeLog, EpisodeSpec, Evaluator


def sweep_expert(
    conditions: Conditions, config: ExpertRobustnessConfig, output: Path, workers: int = 0
) -> ExpertRobustnessReport:
    """Play the conditions that no report in the file's place holds for the present world, and write all of them.

    Conditions that are only seen are left out, since the players there act as in the nominal world.

    Args:
        conditions: of one task.
        config: what is measured.
        output: the report, a JSON file.
        workers: number of processes; 0 takes one per core.

    Raises:
        BimanualError: the file is damaged or of another measurement, or an episode could not be played.
    """
    earlier = read_earlier(ExpertRobustnessReport, output, config, conditions)
    keys = [key for key in conditions if conditions.played_as(key) == key]
    seeds = range(config.first_seed, config.first_seed + config.expert_episodes)
    log = EpisodeLog(output.with_suffix(".partial.jsonl"))
    with Evaluator(workers, log) as evaluator:
        worlds = conditions.worlds(keys, evaluator)
        known = earlier.by_key if earlier else {}
        missing = [key for key in keys if key not in known or known[key].world != worlds[key]]
        template = EpisodeSpec(config.task, ANY_VARIATION, config.split, 0, "expert")
        expert = solved_seeds(evaluator, "expert", missing, template, seeds)
        open_loop = solved_seeds(
            evaluator, "open_loop", missing, template, seeds[: config.open_loop_episodes]
        )
    found = [
        ExpertCondition(
            axis=axis,
            level=level,
            world=worlds[axis, level],
            expert_failed=tuple(seed for seed in seeds if seed not in expert[axis, level]),
            open_loop_solved=open_loop[axis, level],
        )
        for axis, level in missing
    ]
    report = ExpertRobustnessReport(schema_version=3, config=config, **extended(earlier, found, conditions))
    report.write(output)
    log.remove()
    return report
