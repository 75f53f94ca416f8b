"""Robustness results as one table, a line per condition, from which pages, charts and comparisons are made."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

import re
from collections.abc import Mapping

import pandas as pd

from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.results.robustness import NOMINAL, RobustnessResult, condition_name
from lerobot_bimanual.results.statistics import holm, mcnemar_p_value, only_one_solved

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
            lost, won = only_one_solved(result.nominal.solved, each.solved)
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
                    "lost": lost,
                    "won": won,
                    "p": mcnemar_p_value(lost, won) if axis else None,
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
