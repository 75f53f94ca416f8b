"""Results of many benchmarks, side by side, as a page of documentation."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from urllib.parse import quote

from lerobot_bimanual.benchmark.likeness import check_likeness
from lerobot_bimanual.benchmark.measurements import read_worlds
from lerobot_bimanual.benchmark.plan import BenchmarkConfig
from lerobot_bimanual.benchmark.recipe import GROUP as RECIPE_GROUP
from lerobot_bimanual.benchmark.reproduction import beyond_recipe, command, config_of
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.results.statistics import SuccessRate, standard_deviation

PAGE = """\
# Results of the recipe `{recipe}`

Written by `lerobot-bimanual results leaderboard` from the rows in `{folder}`; do not edit.

Each cell is one training with one seed, successes of unseen episodes of the split `test` and their 95 % Wilson interval, or
several trainings, successes of each, their mean and the standard deviation between trainings. The checkpoint was chosen on
the split `val`. The expert acts on the same episodes, and so does the blind control, which plays the mean keyposes of 30
training episodes whatever the scene; of a task with variations it plays each, on all seeds. `_on_` says that one network
has learned from the demonstrations of several tasks, so many of each; its last checkpoint is tested on all of them. Means are
over tasks, of policies that were scored on all.

{success}
{figure}
What each was trained on, for how long by the clock on the machine named in its row, and with which flags of
`lerobot-bimanual policy benchmark` beyond those of the recipe as it is today:

{training}

A row holds the flags of its training, the command of its dataset, every episode and the versions of all packages.
`lerobot-bimanual results verify --results={folder}` plays its test episodes again without the policy, and
compares every state and claim.{again}
"""
AGAIN = """ One cell trained and tested again, that of the last line of a policy that is installed:

```bash
{command}
```"""
FIGURE = """
![Success of each policy, the expert and the blind control on each task, with 95 % Wilson intervals]({link})
"""
NOT_INSTALLED = "its recipe is not installed here"
ABSENT = "–"
EXPERT_CERTIFICATE = "expert.json"
"""Among certificates, the one that covers every task."""


def render(folder: Path, certificates: Path | None = None, figure: str | None = None) -> str:
    """The page of the results in a folder.

    Args:
        folder: of the rows.
        certificates: folder of the certificates, of whose worlds the rows must be; by default the folder
            `certificates` beside that of the rows, if there is one.
        figure: where the figure of these results lies, seen from the page; None for a page without.

    Raises:
        BimanualError: there are no rows, one contradicts itself, its file's name, the others or the certificates, or its
            recipe is installed and yet no command trains it again. The message names the file.
    """
    rows = read_rows(folder)
    check_likeness(rows)
    _check_whole(rows)
    _check_worlds(rows, folder, certificates)
    lines = [
        (row, _config_of(path, row))
        for path, row in sorted(rows.items(), key=lambda item: (_place(item[1]), item[1].learner))
    ]
    configs = [config for _, config in lines if config is not None]
    return PAGE.format(
        recipe=lines[0][0].recipe,
        folder=folder.as_posix(),
        success=success_table(list(rows.values())),
        figure="" if figure is None else FIGURE.format(link=quote(figure)),
        training=_training(lines),
        again=AGAIN.format(command=command(configs[-1])) if configs else "",
    )


def read_rows(folder: Path) -> dict[Path, ResultRow]:
    """The rows in a folder.

    Raises:
        BimanualError: there are none, one contradicts itself, or lies under another row's name.
    """
    paths = sorted(folder.glob("*.json"))
    if not paths:
        raise BimanualError(
            f"{folder} holds no results; `lerobot-bimanual policy benchmark` writes them to OUTPUT/results"
        )
    rows = {path: ResultRow.read(path) for path in paths}
    for path, row in rows.items():
        if path.name != row.file_name:
            raise BimanualError(
                f"{path}: its row is that of a file named {row.file_name}; rename it or leave it out"
            )
    return rows


def _check_whole(rows: Mapping[Path, ResultRow]) -> None:
    """Each was tested on as many episodes as were planned."""
    for path, row in rows.items():
        if row.stopped_against is not None:
            raise BimanualError(
                f"{path}: its test was stopped as soon as it differed from another policy, which favours one side of its "
                "rate; it is for `lerobot-bimanual results compare`, and a table needs a test without --stop_when_sure"
            )


def _check_worlds(rows: Mapping[Path, ResultRow], folder: Path, certificates: Path | None) -> None:
    """Rows are of the certified worlds, but for perturbed ones, of which there is no such certificate."""
    path = (certificates or folder.parent / "certificates") / EXPERT_CERTIFICATE
    if certificates is None and not path.is_file():
        return
    worlds = read_worlds(path)
    for row_path, row in rows.items():
        if row.world != worlds.get(row.task) and not row.evaluation.perturb:
            raise BimanualError(
                f"{row_path}: world of {row.task} is {row.world!r}, but {worlds.get(row.task)!r} in {path}; measure "
                "both in one world"
            )


def _config_of(path: Path, row: ResultRow) -> BenchmarkConfig | None:
    """What trains a row again; None for a policy of somebody else, who is not installed here."""
    if row.policy not in entries(RECIPE_GROUP):
        return None
    try:
        return config_of(row)
    except BimanualError as error:
        raise BimanualError(f"{path}: {error}") from error


def success_table(rows: Sequence[ResultRow]) -> str:
    """The policies, the expert and the blind control side by side, one line per task."""
    cells: defaultdict[tuple[str, str], list[ResultRow]] = defaultdict(list)
    for row in rows:
        cells[_place(row), row.learner].append(row)
    policies = sorted({policy for _, policy in cells})
    places = sorted({place for place, _ in cells})
    beside = {
        place: next(group[0] for (where, _), group in cells.items() if where == place) for place in places
    }
    lines = []
    for place in places:
        rates = beside[place].rates
        scores = [success_cell(cells[place, name]) if (place, name) in cells else ABSENT for name in policies]
        lines.append([f"`{place}`", *scores, str(rates["expert"].successes), _score(rates["blind"])])
    if len(places) > 1:
        means = [mean_cell([cells.get((place, name), []) for place in places]) for name in policies]
        controls = [
            f"{fmean(beside[place].rates[who].rate for place in places):.1%}" for who in ("expert", "blind")
        ]
        lines.append([f"mean of {len(places)}", *means, *controls])
    return markdown_table(["task", *(f"`{name}`" for name in policies), "expert", "blind"], lines)


def mean_cell(cells: Sequence[Sequence[ResultRow]]) -> str:
    """Over tasks, each by the mean of its trainings; of a policy that has been scored on all of them."""
    if not all(cells):
        return ABSENT
    return f"{fmean(fmean(row.rates['policy'].rate for row in rows) for rows in cells):.1%}"


def success_cell(rows: Sequence[ResultRow]) -> str:
    """One training, or several by the seeds of the trainings."""
    ordered = sorted(rows, key=lambda row: int(row.flags["seed"]))
    rates = [row.rates["policy"] for row in ordered]
    if len(rates) == 1:
        return _score(rates[0])
    shares = [rate.rate for rate in rates]
    counts = ", ".join(f"{rate.successes}/{rate.trials}" for rate in rates)
    return f"{counts}: {sum(shares) / len(shares):.1%} ± {standard_deviation(shares):.1%}"


def _training(trained: Sequence[tuple[ResultRow, BenchmarkConfig | None]]) -> str:
    lines = []
    for row, config in trained:
        machine = row.machine.gpu or f"{row.machine.cpus} cores"
        validated = ", ".join(
            f"{validation.step}: {sum(episode.success for episode in validation.episodes)}/{len(validation.episodes)}"
            for validation in row.validation
        )
        demos, minutes = str(len(row.dataset.seeds)), f"{row.training_seconds / 60:.1f}"
        steps = f"{row.checkpoint_step} of {row.flags['steps']}"
        words = None if config is None else beyond_recipe(config)
        beyond = NOT_INSTALLED if words is None else f"`{words}`" if words else ABSENT
        policy = f"`{row.learner}`"
        lines.append([f"`{_place(row)}`", policy, demos, steps, minutes, machine, validated, beyond])
    headings = ["task", "policy", "demos", "steps", "minutes", "machine", "on `val`, by steps"]
    return markdown_table([*headings, "beyond the recipe"], lines)


def _place(row: ResultRow) -> str:
    return row.place


def _score(rate: SuccessRate) -> str:
    low, high = rate.interval
    return f"{rate.successes}/{rate.trials} ({low:.0%} to {high:.0%})"
