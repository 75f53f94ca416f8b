"""Charts of robustness: success on every condition of several policies, and of one policy axis by axis."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import batched, groupby
from statistics import fmean

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.reports.charts import (
    BLUE,
    GREY,
    INK,
    VERMILION,
    Chart,
    new_figure,
    styled,
)
from lerobot_bimanual.reports.drops import SIGNIFICANT, Drop, drops_of
from lerobot_bimanual.reports.trainings import by_policy
from lerobot_bimanual.results.robustness import (
    NOMINAL,
    AxisRecord,
    PolicyCondition,
    RobustnessResult,
    condition_name,
)

LEVELS = range(1, MAX_LEVEL + 1)
MAX_POLICIES = 6
"""Policies side by side, so that numbers of three digits fit; more go below."""
HATCH = "////"
COLUMNS = 4
HEAT_MAP_NOTES = (
    "Percent of the same episodes solved, in the mean over trainings; in a field, levels 1, 2, 3 from left to right.",
    "Hatched: the expert solves too few, so the condition is not valid. Empty: not evaluated, or not applicable to the task.",
)
SWEEP_NOTES = (
    f"Diamond: differs from nominal on the same episodes, McNemar's exact test with p (Holm over axes) up to {SIGNIFICANT}.",
    "Hatched: the expert solves too few, so the condition is not valid and counts in no sum.",
)


@dataclass(frozen=True)
class Column:
    """A policy on a task.

    Attributes:
        task: name of the task.
        policy: name of the policy.
        trainings: results of its trainings.
    """

    task: str
    policy: str
    trainings: Sequence[RobustnessResult]

    def share(self, condition: str) -> float | None:
        """Share of episodes solved, in the mean over trainings; None if one of them was not evaluated."""
        found = [result.by_name.get(condition) for result in self.trainings]
        rates = [each.rates["policy"].rate for each in found if each is not None]
        return fmean(rates) if len(rates) == len(self.trainings) else None

    def is_valid(self, condition: str) -> bool:
        """Whether the expert solves enough in all of them."""
        return all(result.by_name[condition].is_valid for result in self.trainings)

    @property
    def origin(self) -> str:
        """The policy's type and weights, or how often it was trained."""
        first, *others = self.trainings
        return (
            f"{len(others) + 1} trainings"
            if others
            else f"{first.policy} {first.config.checkpoint_sha256[:8]}"
        )

    @property
    def description(self) -> str:
        """What was solved, in words."""
        shares = {condition.name: self.share(condition.name) for condition in self.trainings[0].conditions}
        said = (
            f"{name} {share:.0%}"
            for name, share in shares.items()
            if share is not None and self.is_valid(name)
        )
        return f"{self.policy}, {self.origin}, on {self.task}: {', '.join(said)}."


@styled
def heat_map(results: Mapping[str, RobustnessResult]) -> Chart:
    """One line per axis, one column per policy; the policies of a task side by side.

    Args:
        results: by name.
    """
    found = {axis.name: axis for result in results.values() for axis in result.axes}
    axes = sorted(found.values(), key=lambda axis: (axis.group, axis.name))
    columns = [Column(*key, trainings) for key, trainings in by_policy(results).items()]
    columns.sort(key=lambda column: column.task)
    blocks = [
        block
        for _, of_task in groupby(columns, key=lambda column: column.task)
        for block in batched(of_task, MAX_POLICIES)
    ]
    figure = new_figure(
        (0.2 * (len(axes) + 1) + 0.75) * len(blocks) + 0.8, "Success by condition", *HEAT_MAP_NOTES
    )
    panels = figure.subplots(len(blocks), squeeze=False)[:, 0]
    for panel, block in zip(panels, blocks, strict=True):
        _draw_block(panel, block, axes)
    return Chart(figure, " ".join(column.description for column in columns))


def _draw_block(panel: Axes, columns: Sequence[Column], axes: Sequence[AxisRecord]) -> None:
    names = [
        [NOMINAL] * MAX_LEVEL,
        *([condition_name(axis.name, level) for level in LEVELS] for axis in axes),
    ]
    shares = np.array(
        [[column.share(name) for column in columns for name in row] for row in names], dtype=float
    )
    valid = np.array(
        [
            [column.share(name) is not None and column.is_valid(name) for column in columns for name in row]
            for row in names
        ]
    )
    panel.imshow(np.where(valid, shares, np.nan), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), share in np.ndenumerate(shares):
        is_written = row > 0 or column % MAX_LEVEL == MAX_LEVEL // 2  # nominal has one field for all levels
        if np.isnan(share) or not is_written:
            continue
        color = GREY if not valid[row, column] else "white" if share > 0.55 else INK
        panel.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=color)
    for row, column in np.argwhere(np.isfinite(shares) & ~valid):
        panel.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, hatch=HATCH, linewidth=0))
    panel.set_yticks(range(len(names)), [NOMINAL, *(f"{axis.name} ({axis.group})" for axis in axes)])
    panel.set_xticks(
        [MAX_LEVEL * number + (MAX_LEVEL - 1) / 2 for number in range(len(columns))],
        [f"{column.policy}\n{column.origin}" for column in columns],
    )
    panel.tick_params(length=0, labelsize=7)
    panel.xaxis.tick_top()
    panel.set_title(columns[0].task)
    panel.spines[:].set_visible(False)
    for edge in range(MAX_LEVEL, MAX_LEVEL * len(columns), MAX_LEVEL):
        panel.axvline(edge - 0.5, color="white", linewidth=3)


@styled
def sweep_figure(result: RobustnessResult) -> Chart:
    """One small chart per axis, by group and name: policy, expert and open-loop baseline against level."""
    found = drops_of(result)
    axes = sorted(result.axes, key=lambda axis: (axis.group, axis.name))
    rows = max(1, -(-len(axes) // COLUMNS))
    count = len(result.nominal.episodes)
    title = f"{result.policy} on {result.task}, the same {count} episodes at every level"
    figure = new_figure(1.6 * rows + 1.1, title, *SWEEP_NOTES)
    panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).flatten()
    for axis, panel in zip(axes, panels, strict=False):
        _draw_axis(panel, axis, [result.nominal, *result.of_axis(axis.name)], found)
    for panel in panels[len(axes) :]:
        panel.set_axis_off()
    if axes:
        panels[0].legend(fontsize=6)
    return Chart(figure, _description(result, found))


def _draw_axis(
    panel: Axes, axis: AxisRecord, conditions: Sequence[PolicyCondition], found: Mapping[str, Drop]
) -> None:
    levels = [condition.level for condition in conditions]
    low, high = np.transpose([condition.rates["policy"].interval for condition in conditions])
    panel.fill_between(levels, low, high, color=BLUE, alpha=0.2, linewidth=0)
    for key, label, style, color in (
        ("open_loop", "open loop", "x:", GREY),
        ("expert", "expert", "^--", INK),
        ("policy", "policy, 95 % interval", "o-", BLUE),
    ):
        rates = [condition.rates[key].rate for condition in conditions]
        panel.plot(levels, rates, style, color=color, label=label, markersize=3.5, linewidth=1)
    for condition in conditions:
        drop = found.get(condition.name)
        if drop is not None and drop.is_significant:
            panel.plot(condition.level, condition.rates["policy"].rate, "D", color=VERMILION, markersize=5)
        if not condition.is_valid:
            panel.axvspan(
                condition.level - 0.5,
                condition.level + 0.5,
                fill=False,
                hatch=HATCH,
                linewidth=0,
                edgecolor="0.85",
            )
    magnitudes = ", ".join(f"{magnitude:g}" for magnitude in axis.magnitudes)
    described = textwrap.shorten(f"{magnitudes} {axis.unit}", 36, placeholder=" ...")
    panel.set_title(f"{axis.name} ({axis.group})\n{described}", fontsize=7)
    panel.set(xlim=(-0.5, MAX_LEVEL + 0.5), ylim=(-0.05, 1.05), xticks=range(MAX_LEVEL + 1))
    panel.yaxis.set_major_formatter("{x:.0%}")
    panel.grid(axis="y")
    panel.tick_params(length=0, labelsize=7)


def _description(result: RobustnessResult, found: Mapping[str, Drop]) -> str:
    def counts(condition: PolicyCondition) -> str:
        rates = condition.rates
        return (
            f"{rates['policy'].successes} of {rates['policy'].trials} (expert {rates['expert'].successes}, "
            f"open loop {rates['open_loop'].successes})"
        )

    said = [f"{result.policy} on {result.task}: {NOMINAL} {counts(result.nominal)}."]
    for condition in result.conditions[1:]:
        p_holm = found[condition.name].p_holm
        remark = "not valid" if p_holm is None else f"p (Holm) {p_holm:.3g}"
        said.append(f"{condition.name} {counts(condition)}, {remark}.")
    return " ".join(said)
