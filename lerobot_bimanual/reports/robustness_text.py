"""Robustness of one policy, or of two side by side, in the terminal."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Iterator

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.reports.robustness_table import conditions_table, corrected
from lerobot_bimanual.results.robustness import RobustnessResult, condition_name
from lerobot_bimanual.results.statistics import mcnemar_p_value, only_one_solved
from lerobot_bimanual.terminal import print_table
from lerobot_bimanual.versions import SIMULATION_PACKAGES


def print_robustness(result: RobustnessResult) -> None:
    """Print a line per condition, and what the conditions together say.

    Lost and won are the episodes that are solved only in the nominal world, and only on the condition.
    """
    table = conditions_table({result.policy: result})
    rows = [
        (
            line.condition,
            f"{line.magnitude:g}" if line.level else "",
            line.solved,
            f"{line.low:.0%} to {line.high:.0%}",
            line.expert,
            line.open_loop,
            f"{line.lost}, {line.won}" if line.level else "",
            f"{line.p:.3g}" if line.level else "",
            "" if not line.level else f"{line.p_holm:.3g}" if line.valid else "not valid",
        )
        for line in table.itertuples()
    ]
    headings = ("condition", "magnitude", "policy", "95 % interval", "expert", "open loop", "lost, won")
    title = f"{result.policy} on {result.task}, the same {len(result.nominal.episodes)} episodes"
    print_table((*headings, "p", "p (Holm)"), rows, title)
    sums = table[table.valid].groupby("level")[["solved", "n"]].sum()
    said = "; ".join(f"level {line.Index}: {line.solved} of {line.n}" for line in sums.itertuples())
    print(f"valid conditions together: {said or 'none'}")
    if not table.valid.all():
        invalid = ", ".join(table[~table.valid].condition)
        print(f"not valid, since the expert solves too few, and in no sum: {invalid}")
    if result.not_applicable:
        print(f"not applicable to {result.task}: {', '.join(result.not_applicable)}")


def print_comparison(first: RobustnessResult, second: RobustnessResult) -> None:
    """Print a line per condition of two policies: successes, and McNemar's exact test on the same episodes.

    Its p-values are corrected by Holm for the number of axes with a valid condition of the same level.

    Raises:
        BimanualError: the results differ in task, options, seeds, worlds or simulation.
    """
    for name, one, other in _shared(first, second):
        if one != other:
            raise BimanualError(
                f"the results differ in {name}: {one!r} and {other!r}; compare results of the same episodes"
            )
    table = conditions_table({"first": first}).merge(
        conditions_table({"second": second}), on="condition", suffixes=("", "_second")
    )
    keys = [*zip(table.axis, table.level, strict=True)]
    pairs = [only_one_solved(first.by_key[key].solved, second.by_key[key].solved) for key in keys]
    table["p"], table["valid"] = [mcnemar_p_value(*pair) for pair in pairs], table.valid & table.valid_second
    table["p_holm"] = corrected(table[table.valid], "level")
    rows = [
        (
            line.condition,
            line.solved,
            line.solved_second,
            "{}, {}".format(*pair),
            f"{line.p:.3g}",
            f"{line.p_holm:.3g}" if line.valid else "not valid",
        )
        for line, pair in zip(table.itertuples(), pairs, strict=True)
    ]
    title = f"success on {first.task}, the same {len(first.nominal.episodes)} episodes at every condition"
    print_table(("condition", "first", "second", "only one solved", "p", "p (Holm)"), rows, title)
    sums = table[table.valid].groupby("level")[["solved", "solved_second", "n"]].sum()
    for line in sums.itertuples():
        where = f"valid conditions of level {line.Index}" if line.Index else "nominal"
        print(f"{where}: first {line.solved}, second {line.solved_second} of {line.n}")
    if missing := sorted(first.by_key.keys() ^ second.by_key.keys()):
        print(f"only one has played: {', '.join(condition_name(*key) for key in missing)}")


def _shared(first: RobustnessResult, second: RobustnessResult) -> Iterator[tuple[str, object, object]]:
    """What must be the same in both."""
    yield "task", first.task, second.task
    for name in ("split", "variation", "max_keyposes"):
        yield name, first.config.options.get(name), second.config.options.get(name)
    yield "seeds", first.nominal.seeds, second.nominal.seeds
    for key in first.by_key.keys() & second.by_key.keys():
        yield f"the world of {condition_name(*key)}", first.by_key[key].world, second.by_key[key].world
    for package in SIMULATION_PACKAGES:
        yield package, first.config.versions.get(package), second.config.versions.get(package)
