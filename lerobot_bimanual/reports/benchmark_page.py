"""Page of the results of many benchmarks, side by side."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import TYPE_CHECKING

from pydantic import ConfigDict

from lerobot_bimanual.benchmark.config import BenchmarkConfig, beyond_recipe, command, shortest_config
from lerobot_bimanual.benchmark.recipes import GROUP as RECIPE_GROUP
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.pages import render
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.comparison import check_comparable
from lerobot_bimanual.results.record import Record
from lerobot_bimanual.results.statistics import SuccessRate

if TYPE_CHECKING:
    import pandas as pd

NOT_INSTALLED = "its recipe is not installed here"
ABSENT = "–"
EXPERT_CERTIFICATE = "expert.json"
"""The certificate that covers every task."""


class _Worlds(Record):
    """Part of an expert report."""

    model_config = ConfigDict(extra="ignore")

    worlds: dict[str, str]


def benchmark_page(
    rows: Mapping[Path, BenchmarkResult],
    folder: Path,
    certificates: Path | None = None,
    figure: str | None = None,
) -> str:
    """The page of results.

    Args:
        rows: by file.
        folder: that holds them, for the page to say.
        certificates: folder of the certificates, of whose worlds the results must be; by default the folder
            `certificates` beside `folder`, if there is one.
        figure: link to the figure of these results; None for a page without.

    Raises:
        BimanualError: the results are not comparable, are of other worlds than the certificates, or no command trains one
            of an installed recipe again. The message names the file.
    """
    check_comparable(rows)
    _check_worlds(rows, folder, certificates)
    ordered = sorted(rows.items(), key=lambda item: (item[1].config.eval_key, item[1].config.policy_id))
    configs = [(row, _config_of(path, row)) for path, row in ordered]
    known = [config for _, config in configs if config is not None]
    return render(
        "lerobot_bimanual.reports",
        "benchmark.md",
        recipe=ordered[0][1].config.recipe,
        folder=folder.as_posix(),
        success=success_table(list(rows.values())),
        figure=figure,
        training=_training_table(configs),
        command=command(known[-1]) if known else None,
    )


def read_rows(results: Path) -> dict[Path, BenchmarkResult]:
    """The results in a file, or in the files of a folder, by file.

    Raises:
        BimanualError: there are none, one is wrong, or has the name of another result.
    """
    paths = sorted(results.glob("*.json")) if results.is_dir() else [results]
    if not paths:
        raise BimanualError(
            f"{results} holds no results; `lerobot-bimanual policy benchmark` writes them to OUTPUT/results"
        )
    rows = {path: BenchmarkResult.read(path) for path in paths}
    for path, row in rows.items():
        if path.name != row.config.file_name:
            raise BimanualError(
                f"{path}: a file with this result must be named {row.config.file_name}; rename it"
            )
    return rows


def _check_worlds(rows: Mapping[Path, BenchmarkResult], folder: Path, certificates: Path | None) -> None:
    """Results are of the certified worlds; of perturbed worlds there is no such certificate."""
    path = (certificates or folder.parent / "certificates") / EXPERT_CERTIFICATE
    if certificates is None and not path.is_file():
        return
    worlds = _Worlds.read(path).worlds
    for row_path, row in rows.items():
        if row.world != worlds.get(row.task) and not row.config.perturb:
            raise BimanualError(
                f"{row_path}: world of {row.task} is {row.world!r}, but {worlds.get(row.task)!r} in {path}; measure "
                "both in one world"
            )


def _config_of(path: Path, row: BenchmarkResult) -> BenchmarkConfig | None:
    """What trains a row again; None if its policy is not installed."""
    if row.config.policy not in entries(RECIPE_GROUP):
        return None
    try:
        return shortest_config(row.config)
    except BimanualError as error:
        raise BimanualError(f"{path}: {error}") from error


def success_table(rows: Sequence[BenchmarkResult]) -> pd.DataFrame:
    """The policies, the expert and the open-loop baseline side by side, one line per task."""
    import pandas as pd

    cells: defaultdict[str, defaultdict[str, list[BenchmarkResult]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        cells[row.config.eval_key][row.config.policy_id].append(row)
    policies = sorted({row.config.policy_id for row in rows})
    baselines = {place: next(iter(cells[place].values()))[0].rates for place in sorted(cells)}
    lines = [
        [
            f"`{place}`",
            *(success_cell(cells[place].get(policy, [])) for policy in policies),
            str(rates["expert"].successes),
            _score(rates["open_loop"]),
        ]
        for place, rates in baselines.items()
    ]
    if len(lines) > 1:
        means = [mean_cell([cells[place].get(policy, []) for place in baselines]) for policy in policies]
        others = [
            f"{fmean(rates[name].rate for rates in baselines.values()):.1%}"
            for name in ("expert", "open_loop")
        ]
        lines.append([f"mean of {len(lines)}", *means, *others])
    return pd.DataFrame(lines, columns=["task", *(f"`{name}`" for name in policies), "expert", "open loop"])


def mean_cell(cells: Sequence[Sequence[BenchmarkResult]]) -> str:
    """Mean over tasks, each with the mean of its trainings; of a policy that was scored on all of them."""
    if not all(cells):
        return ABSENT
    return f"{fmean(fmean(row.rates['policy'].rate for row in rows) for rows in cells):.1%}"


def success_cell(rows: Sequence[BenchmarkResult]) -> str:
    """Success of no training, of one, or of several in the order of their seeds."""
    ordered = sorted(rows, key=lambda row: row.config.seed)
    rates = [row.rates["policy"] for row in ordered]
    if len(rates) < 2:
        return _score(rates[0]) if rates else ABSENT
    shares = [rate.rate for rate in rates]
    counts = ", ".join(f"{rate.successes}/{rate.trials}" for rate in rates)
    return f"{counts}: {fmean(shares):.1%} ± {stdev(shares):.1%}"


def _training_table(trained: Sequence[tuple[BenchmarkResult, BenchmarkConfig | None]]) -> pd.DataFrame:
    import pandas as pd

    lines = []
    for row, config in trained:
        validated = (
            f"{each.step}: {sum(episode.success for episode in each.episodes)}/{len(each.episodes)}"
            for each in row.validation
        )
        words = None if config is None else beyond_recipe(config)
        lines.append(
            {
                "task": f"`{row.config.eval_key}`",
                "policy": f"`{row.config.policy_id}`",
                "demos": len(row.demonstrations.seeds),
                "steps": f"{row.checkpoint_step} of {row.config.steps}",
                "minutes": f"{row.training_seconds / 60:.1f}",
                "machine": row.machine.gpu or f"{row.machine.cpus} cores",
                "on `val`, by steps": ", ".join(validated),
                "beyond the recipe": NOT_INSTALLED if words is None else f"`{words}`" if words else ABSENT,
            }
        )
    return pd.DataFrame(lines)


def _score(rate: SuccessRate) -> str:
    low, high = rate.interval
    return f"{rate.successes}/{rate.trials} ({low:.0%} to {high:.0%})"
