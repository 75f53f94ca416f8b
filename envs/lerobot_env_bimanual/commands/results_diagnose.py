"""The verb `blame`: why episodes failed, at which keypose, and by which arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.errors import InvalidChoice, check_range

if TYPE_CHECKING:
    from lerobot_env_bimanual.audit.blame import Blame
    from lerobot_env_bimanual.audit.result_files import Result


@dataclass
class ResultsDiagnoseConfig:
    """Options of the verb `blame`."""

    # A file, or a folder of files: rows of `benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    # Whose rows: a column of the board, as peract2 or peract2_on_all; by default everybody's.
    policy: str | None = None
    sample: int = 0  # failed episodes looked at of each result, drawn at random; 0 takes all
    seed: int = 0  # of the draws
    output: Path | None = None  # JSON file with all that was found
    figure: Path | None = None  # PNG: at which keypose episodes were lost, and by whom
    workers: int = 0  # processes; 0 takes one per core


def results_diagnose(config: ResultsDiagnoseConfig) -> int:
    """Say of failed episodes why they failed, which keypose lost them, and which arm.

    Each failed episode is played again from its seed, and classed by rules from physics. If it was played by keyposes,
    the expert takes over with both arms from a snapshot before each of them: the last one before which it still
    succeeds has lost the episode. There the keypose of one arm alone is replaced by the expert's: if that suffices,
    this arm lost it; if either suffices, either; if neither does, their coordination. No weights are needed.

    Examples:
        lerobot-bimanual results diagnose --results=results/leaderboard --policy=peract2
        lerobot-bimanual results diagnose --results=outputs/eval/lift_ball_test_record.json --figure=outputs/blame.png
        lerobot-bimanual results diagnose --results=results/leaderboard --sample=5 --output=outputs/blame.json
    """
    import numpy as np

    from lerobot_bimanual.files import check_output_file
    from lerobot_env_bimanual.audit.blaming import blames_of
    from lerobot_env_bimanual.audit.result_files import Result, drawn, result_files
    from lerobot_env_bimanual.audit.result_names import result_names
    from lerobot_env_bimanual.workers import WorkerPool

    check_range("sample", config.sample, 0)
    check_range("seed", config.seed, 0)
    if config.output is not None:
        check_output_file(config.output)
    if config.figure is not None:
        from lerobot_bimanual.reports.charts import check_chart_file

        check_chart_file(config.figure)
    results = _chosen([Result.read(path) for path in result_files(config.results)], config.policy)
    names = result_names(results)
    found: dict[Path, list[Blame]] = {}
    with WorkerPool(config.workers) as pool:
        for result in results:
            result.check_world()
            record = result.record
            failed = tuple(episode for episode in record.episodes if not episode.success)
            rng = np.random.default_rng(config.seed)
            blames = blames_of(record, drawn(failed, config.sample, rng), pool)
            found[result.path] = blames
            print(f"{result.path}: {len(record.episodes)} episodes of {record.task}, {len(failed)} failed")
            _print_table(blames)
    groups: dict[str, list[Blame]] = {}
    for result in results:
        groups.setdefault(names[result.path], []).extend(found[result.path])
    _print_sums(groups)
    if config.output is not None:
        _write(results, found, config.output)
    if config.figure is not None:
        from lerobot_env_bimanual.reports.failure_figure import failure_figure

        failure_figure(groups).save(config.figure)
    return 0


def _chosen(results: list[Result], policy: str | None) -> list[Result]:
    """The results of one policy, or all.

    Raises:
        InvalidChoice: there are rows, or none, but none of this policy.
    """
    if policy is None:
        return results
    policies = sorted({result.row.config.policy_id for result in results if result.row})
    if policy not in policies:
        raise InvalidChoice(
            "policy", policy, policies or "left out, since no result of `policy benchmark` is there"
        )
    return [result for result in results if result.row and result.row.config.policy_id == policy]


def _print_table(blames: Sequence[Blame]) -> None:
    from lerobot_bimanual.tables import print_table

    headings = ("seed", "class", "last recoverable keypose", "lost by", "fact")
    rows = [
        (
            attribution.seed,
            attribution.failure_class,
            _shown(attribution.last_recoverable),
            attribution.loser,
            attribution.fact,
        )
        for attribution in blames
    ]
    if rows:
        print_table(headings, rows)


def _shown(index: int | None) -> str:
    return "" if index is None else str(index)


def _print_sums(groups: dict[str, list[Blame]]) -> None:
    from lerobot_bimanual.tables import print_table
    from lerobot_env_bimanual.audit.blame import Loser
    from lerobot_env_bimanual.audit.failure_class import FailureClass

    for heading, kinds, attribute in (
        ("class", FailureClass, "failure_class"),
        ("who lost them", Loser, "loser"),
    ):
        kinds_of = {
            name: [getattr(attribution, attribute) for attribution in blames]
            for name, blames in groups.items()
        }
        rows = [
            (name, *(of_group.count(kind) for kind in kinds), len(of_group))
            for name, of_group in kinds_of.items()
        ]
        print_table(("task", *kinds, "failed"), rows, f"By {heading}:")


def _write(results: Sequence[Result], found: dict[Path, list[Blame]], output: Path) -> None:
    """Write all that was found, by task, each episode with where it comes from."""
    import json
    from dataclasses import asdict

    from lerobot_bimanual.files import write_file

    content: dict[str, list[dict[str, Any]]] = {}
    for result in results:
        policy = (
            result.row.config.policy_id if result.row else ""
        )  # a record does not say whose episodes it has
        source = {"file": str(result.path), "policy": policy, "perturb": result.record.perturb}
        content.setdefault(result.record.task, []).extend(
            source | asdict(attribution) for attribution in found[result.path]
        )
    write_file(output, json.dumps(content, indent=1) + "\n")
