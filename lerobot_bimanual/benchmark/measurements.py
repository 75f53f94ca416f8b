"""Results of the programs of a benchmark, read from their files and compared with what was asked of them."""

from collections.abc import Sequence
from pathlib import Path

from pydantic import ConfigDict

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.expert_report import ExpertReport
from lerobot_bimanual.results.record import BadRecord, Record


class _Partial(Record):
    """Fields of a file that holds others, too."""

    model_config = ConfigDict(extra="ignore")


class _Metrics(_Partial):
    successes: tuple[bool, ...]


class _TaskResult(_Partial):
    metrics: _Metrics


class _LeRobotEvaluation(_Partial):
    """Part of `lerobot-eval`'s `eval_info.json`."""

    per_task: tuple[_TaskResult, ...]


def read_successes(path: Path, seeds: Sequence[int]) -> tuple[Episode, ...]:
    """Episodes of a `lerobot-eval` result of one task.

    Args:
        path: the file.
        seeds: seeds of its episodes; LeRobot counts them up from the first, without listing them.

    Raises:
        BadRecord: the file is not such a result, or holds several tasks or another number of episodes.
    """
    tasks = _LeRobotEvaluation.read(path).per_task
    if len(tasks) != 1 or len(successes := tasks[0].metrics.successes) != len(seeds):
        counts = [len(task.metrics.successes) for task in tasks]
        raise BadRecord(
            f"{path} holds {counts} episodes of {len(tasks)} tasks, but must hold {len(seeds)} of one"
        )
    return tuple(Episode(seed=seed, success=success) for seed, success in zip(seeds, successes, strict=True))


def read_record(path: Path, seeds: Sequence[int], counted: Sequence[Episode]) -> EvaluationRecord:
    """The record of an evaluation, without the episodes that filled up its last batch.

    Args:
        path: the file.
        seeds: seeds of the episodes that were asked for, increasing.
        counted: the same episodes as `lerobot-eval` counted them.

    Raises:
        BadRecord: the file is not such a record, an episode is missing, or `lerobot-eval` counted another success.
    """
    record = EvaluationRecord.read(path)
    episodes = tuple(episode for episode in record.episodes if episode.seed in seeds)
    if [episode.seed for episode in episodes] != list(seeds):
        raise BadRecord(
            f"{path} does not hold the seeds {seeds[0]} to {seeds[-1]}; remove it to evaluate again"
        )
    for played, other in zip(episodes, counted, strict=True):
        if played.success != other.success:
            raise BadRecord(
                f"{path}: seed {played.seed} has success {played.success}, but lerobot-eval counted {other.success}"
            )
    return record.model_copy(update={"episodes": episodes})


def read_report(path: Path, player: str, task: str, seeds: Sequence[int]) -> tuple[str, tuple[Episode, ...]]:
    """World and episodes, sorted by variation and seed, of the report of the expert or a baseline on one task.

    Raises:
        BadRecord: the file is not such a report, or of another player, split, task or other seeds.
    """
    report = ExpertReport.read(path)
    found = (report.player, report.discretise, report.split, report.tasks, [*report.seeds])
    if found != (player, 0, "test", [task], [*seeds]):
        raise BadRecord(
            f"{path} is not of {player} on the seeds {seeds[0]} to {seeds[-1]} of {task} in the split test; remove the file "
            "to measure again"
        )
    kept = ("seed", "variation", "success", "failure", "state_hash")
    episodes = sorted(report.episodes, key=lambda episode: (episode.variation, episode.seed))
    return report.worlds[task], tuple(
        Episode(**{name: getattr(episode, name) for name in kept}) for episode in episodes
    )


def check_one_world(worlds: dict[Path, str], task: str) -> None:
    """Files may have been made long before each other, but must be of one world.

    Raises:
        BimanualError: they are not; the message names the file that differs.
    """
    (first, world), *others = worlds.items()
    for path, other in others:
        if other != world:
            raise BimanualError(
                f"{path} is of the world {other} of {task}, but {first} of {world}: it has changed between them; choose "
                "another --output, or remove the older one, of demonstrations with the trainings beside them"
            )
