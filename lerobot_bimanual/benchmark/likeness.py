"""What results must share to stand side by side, and what trainings must share to be several of one policy."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from lerobot_bimanual.benchmark.episode_result import EpisodeResult
from lerobot_bimanual.benchmark.flag_text import command_flags
from lerobot_bimanual.benchmark.names import perturbed
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.versions import SIMULATION_PACKAGES

type Rows = Mapping[Path, ResultRow]

DATASET_PLACES = ("root", "repo_id")
"""Flags of the demonstrations' command that only say where they lie."""


def check_likeness(rows: Rows) -> None:
    """Rows of one table share recipe and simulation; those of one line the world, and who played beside the policy.

    Raises:
        BimanualError: they do not, or trainings of one policy are not alike; the message names both files.
    """
    _check(rows, _of_table)
    check_trainings(rows)


def check_trainings(rows: Rows) -> None:
    """Trainings of one policy are of one recipe, and those for one line differ in their weights and seed, and in nothing else.

    Raises:
        BimanualError: they are not; the message names both files.
    """
    _check(rows, _of_training)
    first: dict[tuple[str, str, str], Path] = {}
    for path, row in rows.items():
        elsewhere = first.setdefault((row.place, row.learner, row.checkpoint_sha256), path)
        if elsewhere != path:
            raise BimanualError(
                f"{path}: it has the weights of {elsewhere}, so it is no other training; leave one out"
            )


def _check(rows: Rows, facts: Callable[[ResultRow], Mapping[str, object]]) -> None:
    first: dict[str, tuple[Path, object]] = {}
    for path, row in rows.items():
        for name, value in facts(row).items():
            elsewhere, other = first.setdefault(name, (path, value))
            if value != other:
                raise BimanualError(
                    f"{path}: {name} is {shown(value)}, but {shown(other)} in {elsewhere}; keep what is alike"
                )


def _of_table(row: ResultRow) -> dict[str, object]:
    return {
        "recipe": row.recipe,
        "versions": {package: row.versions[package] for package in SIMULATION_PACKAGES},
        f"world of {perturbed(row.task, row.evaluation.perturb)}": row.world,
        f"expert on {row.place}": _played(row.expert),
        f"blind on {row.place}": _played(row.blind),
    }


def _of_training(row: ResultRow) -> dict[str, object]:
    of = f"of {row.learner} on {row.place}"
    trained = {name: value for name, value in row.flags.items() if name != "seed"}
    # Their number, the size of their images and what is different in them stand there.
    command = command_flags(row.dataset.command)
    demonstrated = {name: value for name, value in command.items() if name not in DATASET_PLACES}
    facts: dict[str, object] = {f"recipe of {row.learner}": row.recipe}
    for kind, flags in (
        ("flag", trained),
        ("demonstrations' flag", demonstrated),
        ("test's option", row.options),
    ):
        facts[f"{kind}s {of}"] = sorted(flags)
        facts |= {f"{kind} {name} {of}": value for name, value in flags.items()}
    return facts


def _played(episodes: Sequence[EpisodeResult]) -> list[tuple[int, int | None, bool]]:
    """What does not depend on the processor."""
    return sorted((episode.seed, episode.variation, episode.success) for episode in episodes)
