"""Rows in the form in which the Hub shows evaluations beside a model: `.eval_results/*.yaml` in its repository."""

from pathlib import Path

import yaml
from huggingface_hub import EvalResultEntry, eval_result_entries_to_yaml

from lerobot_bimanual.files import write_file
from lerobot_bimanual.reports.benchmark_page import read_results
from lerobot_bimanual.results.benchmark import BenchmarkResult


def write_hub_results(results: Path, folder: Path, benchmark: str) -> list[Path]:
    """Write a file per row, to be uploaded into `.eval_results/` of the repository that holds the row's weights.

    Args:
        results: folder of the rows.
        folder: where the files go.
        benchmark: repository of the benchmark's dataset, ORGANISATION/NAME.

    Returns:
        The files.

    Raises:
        BimanualError: there are no rows, or one is wrong.
        UnwritableOutput: a file cannot be written.
    """
    written = []
    for path, row in read_results(results).items():
        entries = eval_result_entries_to_yaml([entry_of(row, benchmark)])
        file = folder / f"{path.stem}.yaml"
        write_file(file, yaml.safe_dump(entries, sort_keys=False, allow_unicode=True))
        written.append(file)
    return written


def entry_of(row: BenchmarkResult, benchmark: str) -> EvalResultEntry:
    """One row as the Hub has it: success in percent, and what a reader must know of it in a line."""
    rate = row.rates["policy"]
    low, high = rate.interval
    return EvalResultEntry(
        dataset_id=benchmark,
        task_id=row.config.eval_key,
        value=round(100 * rate.rate, 1),
        date=row.date,
        notes=(
            f"{rate.successes} of {rate.trials} unseen episodes solved (95 % Wilson {low:.0%} to {high:.0%}); "
            f"{row.config.policy_id}, recipe {row.config.recipe}, {len(row.demonstrations.seeds)} demonstrations, training seed "
            f"{row.config.seed}, world {row.world}, weights {row.checkpoint_sha256[:12]}"
        ),
    )
