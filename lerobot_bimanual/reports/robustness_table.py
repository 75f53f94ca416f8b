"""Robustness results as one table, a line per condition, for pages, charts, comparisons and the terminal."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pandas as pd

from lerobot_bimanual.distributions import SIMULATION_PACKAGES
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.results.robustness import NOMINAL, RobustnessResult, condition_name
from lerobot_bimanual.results.statistics import holm, sign_flip_p_value
from lerobot_bimanual.terminal import print_table, say

SIGNIFICANT = 0.05
"""Corrected p-values up to this one count as a difference."""
LEVELS = range(1, MAX_LEVEL + 1)
TRAINING_SEED = re.compile(r"_seed\d+$")
"""Results whose names differ in nothing else, beside the task, are trainings of one policy."""


def conditions_table(results: Mapping[str, RobustnessResult]) -> pd.DataFrame:
    """One line per result and condition.

    Args:
        results: by name.

    Returns:
        Columns `result`, `label` (name without the task), `policy` (label without the training seed), `task`,
        `checkpoint`, `condition`, `axis`, `group`, `level`, `magnitude`, `world`, `seeds`, `n` (episodes), `solved`, `low`
        and `high` (95 % interval of the rate), `expert` and `open_loop` (episodes solved), `valid`, and beside the nominal
        world `lost`, `won` (episodes), `p` (McNemar's exact test) and `p_holm` (corrected by Holm for the number of axes
        with a valid condition of the same level; NaN if the condition is not valid).
    """
    lines = []
    for name, result in results.items():
        axes = {axis.name: axis for axis in result.axes}
        label = name.removeprefix(f"{result.task}_")
        for each in result.conditions:
            rates, axis = each.rates, axes.get(each.axis)
            changes = each.changes_from(result.nominal)
            low, high = rates["policy"].interval
            lines.append(
                {
                    "result": name,
                    "label": label,
                    "policy": TRAINING_SEED.sub("", label),
                    "task": result.task,
                    "checkpoint": result.config.checkpoint_sha256,
                    "condition": each.name,
                    "axis": each.axis,
                    "group": axis.group if axis else "",
                    "level": each.level,
                    "magnitude": axis.magnitudes[each.level - 1] if axis else None,
                    "world": each.world,
                    "seeds": tuple(each.seeds),
                    "n": len(each.episodes),
                    "solved": rates["policy"].successes,
                    "low": low,
                    "high": high,
                    "expert": rates["expert"].successes,
                    "open_loop": rates["open_loop"].successes,
                    "valid": each.is_valid,
                    "lost": changes.count(-1),
                    "won": changes.count(1),
                    "p": sign_flip_p_value(changes) if axis else None,
                }
            )
    table = pd.DataFrame(lines)
    table["p_holm"] = corrected(table[(table.level > 0) & table.valid], ["result", "level"])
    return table


def corrected(table: pd.DataFrame, by: str | list[str]) -> pd.Series:
    """Column `p` corrected by Holm within groups of lines."""
    if table.empty:
        return pd.Series(index=table.index, dtype=float)
    return table.groupby(by).p.transform(lambda p: holm([*p]))


def axis_names(table: pd.DataFrame) -> list[str]:
    """Axes of a table of conditions, by group and name."""
    perturbed = table[table.level > 0]
    return [*perturbed.sort_values(["group", "axis"]).axis.drop_duplicates()]


def by_axis(cells: pd.DataFrame, axes: list[str]) -> pd.DataFrame:
    """Texts of conditions as a table with a line for the nominal world and one per axis, levels side by side.

    Args:
        cells: texts; the index has names of conditions. What is absent becomes a point.
        axes: names of the axes, in their order.
    """
    lines = {NOMINAL: [NOMINAL]} | {axis: [condition_name(axis, level) for level in LEVELS] for axis in axes}
    filled = cells.reindex([name for names in lines.values() for name in names]).fillna(".")
    joined = {column: [" ".join(filled.loc[names, column]) for names in lines.values()] for column in cells}
    return pd.DataFrame({"axis": [*lines], **joined})


def print_robustness(result: RobustnessResult) -> None:
    """Print a line per condition, and what the conditions together say.

    Lost and won are the episodes that are solved only in the nominal world, and only on the condition.
    """
    table = conditions_table({result.policy: result})
    shown = pd.DataFrame(
        {
            "condition": line.condition,
            "magnitude": f"{line.magnitude:g}" if line.level else "",
            "policy": line.solved,
            "95 % interval": f"{line.low:.0%} to {line.high:.0%}",
            "expert": line.expert,
            "open loop": line.open_loop,
            "lost, won": f"{line.lost}, {line.won}" if line.level else "",
            "p": f"{line.p:.3g}" if line.level else "",
            "p (Holm)": _corrected_text(line) if line.level else "",
        }
        for line in table.itertuples()
    )
    print_table(shown, f"{result.policy} on {result.task}, the same {len(result.nominal.episodes)} episodes")
    sums = table[table.valid].groupby("level")[["solved", "n"]].sum()
    said = "; ".join(f"level {line.Index}: {line.solved} of {line.n}" for line in sums.itertuples())
    say(f"valid conditions together: {said or 'none'}")
    if not table.valid.all():
        invalid = ", ".join(table[~table.valid].condition)
        say(f"not valid, since the expert solves too few, and in no sum: {invalid}")
    if result.not_applicable:
        say(f"not applicable to {result.task}: {', '.join(result.not_applicable)}")


def print_comparison(first: RobustnessResult, second: RobustnessResult) -> None:
    """Print a line per condition of two policies: successes, and McNemar's exact test on the same episodes.

    Its p-values are corrected by Holm for the number of axes with a valid condition of the same level.

    Raises:
        BimanualError: the results differ in task, options, seeds, worlds or simulation.
    """
    shared = first.by_key.keys() & second.by_key.keys()
    one, other = (
        {"task": result.task, "seeds": result.nominal.seeds}
        | {name: result.config.options.get(name) for name in ("split", "variation", "max_keyposes")}
        | {f"the world of {condition_name(*key)}": result.by_key[key].world for key in shared}
        | {package: result.config.versions.get(package) for package in SIMULATION_PACKAGES}
        for result in (first, second)
    )
    for name in one:
        if one[name] != other[name]:
            raise BimanualError(
                f"the results differ in {name}: {one[name]!r} and {other[name]!r}; compare results of the same episodes"
            )
    table = conditions_table({"first": first}).merge(
        conditions_table({"second": second}), on="condition", suffixes=("", "_second")
    )
    keys = [*zip(table.axis, table.level, strict=True)]
    table["changes"] = [second.by_key[key].changes_from(first.by_key[key]) for key in keys]
    table["p"], table["valid"] = table.changes.map(sign_flip_p_value), table.valid & table.valid_second
    table["p_holm"] = corrected(table[table.valid], "level")
    shown = pd.DataFrame(
        {
            "condition": line.condition,
            "first": line.solved,
            "second": line.solved_second,
            "only one solved": f"{line.changes.count(-1)}, {line.changes.count(1)}",
            "p": f"{line.p:.3g}",
            "p (Holm)": _corrected_text(line),
        }
        for line in table.itertuples()
    )
    count = len(first.nominal.episodes)
    print_table(shown, f"success on {first.task}, the same {count} episodes at every condition")
    sums = table[table.valid].groupby("level")[["solved", "solved_second", "n"]].sum()
    for line in sums.itertuples():
        where = f"valid conditions of level {line.Index}" if line.Index else "nominal"
        say(f"{where}: first {line.solved}, second {line.solved_second} of {line.n}")
    if missing := sorted(first.by_key.keys() ^ second.by_key.keys()):
        say(f"only one has played: {', '.join(condition_name(*key) for key in missing)}")


def _corrected_text(line: Any) -> str:
    return f"{line.p_holm:.3g}" if line.valid else "not valid"
