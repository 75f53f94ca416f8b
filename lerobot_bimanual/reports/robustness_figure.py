"""Chart of robustness: success on every condition, policies side by side."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import batched

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.reports.charts import GREY, INK, Chart, new_figure, styled
from lerobot_bimanual.reports.robustness_table import LEVELS, axis_names, conditions_table
from lerobot_bimanual.results.robustness import NOMINAL, RobustnessResult, condition_name

MAX_POLICIES = 6
"""Policies side by side, so that numbers of three digits fit; more go below."""
HATCH = "////"
HEAT_MAP_NOTES = (
    "Percent of the same episodes solved, in the mean over trainings; in a field, levels 1, 2, 3 from left to right.",
    "Hatched: the expert solves too few, so the condition is not valid. Empty: not evaluated, or not applicable to the task.",
)


@styled
def heat_map(results: Mapping[str, RobustnessResult]) -> Chart:
    """One line per axis, one column per policy; the policies of a task side by side.

    Args:
        results: by name.
    """
    table = conditions_table(results).assign(rate=lambda table: table.solved / table.n)
    axes = {axis.name: axis.group for result in results.values() for axis in result.axes}
    by_policy = table.groupby(["task", "policy"], sort=False)
    table["trainings"] = by_policy.result.transform("nunique")
    cells = table.groupby(["task", "policy", "condition"], sort=False).agg(
        share=("rate", "mean"),
        valid=("valid", "all"),
        found=("result", "count"),
        trainings=("trainings", "max"),
    )
    cells = cells[cells.found == cells.trainings]  # of each training
    origins = {
        key: f"{trainings} trainings" if trainings > 1 else f"{results[name].policy} {checkpoint[:8]}"
        for key, trainings, name, checkpoint in by_policy[["trainings", "result", "checkpoint"]]
        .first()
        .itertuples()
    }
    blocks = [
        block
        for task in sorted({task for task, _ in origins})
        for block in batched([key for key in origins if key[0] == task], MAX_POLICIES)
    ]
    rows = [(NOMINAL, ""), *((name, axes[name]) for name in axis_names(table))]
    figure = new_figure((0.2 * len(rows) + 0.75) * len(blocks) + 0.8, "Success by condition", *HEAT_MAP_NOTES)
    for panel, block in zip(figure.subplots(len(blocks), squeeze=False)[:, 0], blocks, strict=True):
        _draw_block(panel, cells, rows, {key: origins[key] for key in block})
    said = (
        _column_text(*key, origin, cells.loc[key])
        for block in blocks
        for key, origin in origins.items()
        if key in block
    )
    return Chart(figure, " ".join(said))


def _column_text(task: str, policy: str, origin: str, cells: pd.DataFrame) -> str:
    valid = cells[cells.valid]
    said = (f"{name} {share:.0%}" for name, share in valid.share.items())
    return f"{policy}, {origin}, on {task}: {', '.join(said)}."


def _draw_block(
    panel: Axes, cells: pd.DataFrame, rows: Sequence[tuple[str, str]], origins: Mapping[tuple[str, str], str]
) -> None:
    names = [
        [NOMINAL] * MAX_LEVEL,
        *([condition_name(axis, level) for level in LEVELS] for axis, _ in rows[1:]),
    ]
    places = [(*key, name) for of_row in names for key in origins for name in of_row]
    found = cells.reindex(pd.MultiIndex.from_tuples(places))
    shape = len(rows), MAX_LEVEL * len(origins)
    shares = found.share.to_numpy(float).reshape(shape)
    valid = (found.valid == True).to_numpy().reshape(shape)  # noqa: E712  what is absent is not valid
    panel.imshow(np.where(valid, shares, np.nan), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), share in np.ndenumerate(shares):
        is_written = row > 0 or column % MAX_LEVEL == MAX_LEVEL // 2  # nominal has one field for all levels
        if np.isnan(share) or not is_written:
            continue
        color = GREY if not valid[row, column] else "white" if share > 0.55 else INK
        panel.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=color)
    for row, column in np.argwhere(np.isfinite(shares) & ~valid):
        panel.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, hatch=HATCH, linewidth=0))
    panel.set_yticks(range(len(rows)), [f"{name} ({group})" if group else name for name, group in rows])
    panel.set_xticks(
        [MAX_LEVEL * number + (MAX_LEVEL - 1) / 2 for number in range(len(origins))],
        [f"{policy}\n{origin}" for (_, policy), origin in origins.items()],
    )
    panel.tick_params(length=0, labelsize=7)
    panel.xaxis.tick_top()
    panel.set_title(next(iter(origins))[0])
    panel.spines[:].set_visible(False)
    for edge in range(MAX_LEVEL, shape[1], MAX_LEVEL):
        panel.axvline(edge - 0.5, color="white", linewidth=3)
