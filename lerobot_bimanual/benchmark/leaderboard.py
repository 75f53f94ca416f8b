"""Results of many benchmarks, side by side, as a page of documentation."""

from collections.abc import Sequence
from pathlib import Path

from lerobot_bimanual.benchmark.plan import BenchmarkConfig
from lerobot_bimanual.benchmark.reproduction import beyond_recipe, command, config_of
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.statistics import SuccessRate

PAGE = """\
# Results of the recipe `{recipe}`

Written by `lerobot-bimanual leaderboard` from the rows in `{folder}`; do not edit.

Each cell is one training with one seed: successes of unseen episodes of the split `test` and their 95 % Wilson interval.
The checkpoint was chosen on the split `val`. The expert acts on the same episodes, and so does the blind control, which
plays the mean keyposes of 30 training episodes whatever the scene; of a task with variations it plays each, on all seeds.

{success}

What each was trained on, for how long by the clock on the machine named in its row, and with which flags of
`lerobot-bimanual benchmark` beyond those of the recipe as it is today:

{training}

A row holds the flags of its training, the command of its dataset, every episode and the versions of all packages. One
cell again, that of the last line:

```bash
{command}
```
"""
ABSENT = "–"


def render(folder: Path) -> str:
    """The page of the results in a folder.

    Raises:
        BimanualError: there are none, they are of several recipes, or two are of the same task and policy.
        BadResult: a file is no result.
    """
    rows = [ResultRow.read(path) for path in sorted(folder.glob("*.json"))]
    recipes = sorted({row.recipe for row in rows})
    if len(recipes) != 1:
        raise BimanualError(
            f"{folder} holds results of {', '.join(recipes) or 'no'} recipe(s), but must hold those of one; "
            "`lerobot-bimanual benchmark` writes them to OUTPUT/results"
        )
    lines = [(row, config_of(row)) for row in sorted(rows, key=lambda row: (_place(row), row.policy))]
    cells = {(_place(row), row.policy): row for row in rows}
    if len(cells) != len(rows):
        raise BimanualError(
            f"{folder} holds two results of the same task, variation and policy; keep one of them"
        )
    return PAGE.format(
        recipe=recipes[0],
        folder=folder.as_posix(),
        success=_success(cells),
        training=_training(lines),
        command=command(lines[-1][1]),
    )


def _success(cells: dict[tuple[str, str], ResultRow]) -> str:
    policies = sorted({policy for _, policy in cells})
    lines = []
    for place in sorted({place for place, _ in cells}):
        row = next(row for (where, _), row in cells.items() if where == place)
        scores = [
            _score(cells[place, name].rates["policy"]) if (place, name) in cells else ABSENT
            for name in policies
        ]
        lines.append([f"`{place}`", *scores, str(row.rates["expert"].successes), _score(row.rates["blind"])])
    return markdown_table(["task", *(f"`{name}`" for name in policies), "expert", "blind"], lines)


def _training(trained: Sequence[tuple[ResultRow, BenchmarkConfig]]) -> str:
    lines = []
    for row, config in trained:
        machine = row.machine.gpu or f"{row.machine.cpus} cores"
        validated = ", ".join(
            f"{validation.step}: {sum(episode.success for episode in validation.episodes)}/{len(validation.episodes)}"
            for validation in row.validation
        )
        demos, minutes = str(len(row.dataset.seeds)), f"{row.training_seconds / 60:.1f}"
        steps = f"{row.checkpoint_step} of {row.flags['steps']}"
        beyond = f"`{words}`" if (words := beyond_recipe(config)) else ABSENT
        policy = f"`{row.policy}`"
        lines.append([f"`{_place(row)}`", policy, demos, steps, minutes, machine, validated, beyond])
    headings = ["task", "policy", "demos", "steps", "minutes", "machine", "on `val`, by steps"]
    return markdown_table([*headings, "beyond the recipe"], lines)


def _place(row: ResultRow) -> str:
    return row.task if row.variation == "any" else f"{row.task} {row.variation}"


def _score(rate: SuccessRate) -> str:
    low, high = rate.interval
    return f"{rate.successes}/{rate.trials} ({low:.0%} to {high:.0%})"
