"""Chart of failed episodes: at which keypose they were lost, and by which arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from lerobot_bimanual.reports.charts import BLUE, INK, ORANGE, YELLOW, Chart, new_figure, styled
from lerobot_env_bimanual.failures.attribution import Attribution, Responsible

COLORS = {
    Responsible.LEFT: BLUE,
    Responsible.RIGHT: ORANGE,
    Responsible.EITHER: INK,
    Responsible.COORDINATION: YELLOW,
    Responsible.TIME: "white",
}
"""From the bottom of a bar; five steps of grey where there are no colours."""
COLUMNS = 3


@styled
def failure_figure(found: Mapping[str, Sequence[Attribution]]) -> Chart:
    """Stacked bars, one panel per task with failed episodes.

    Args:
        found: the attributed failures of each task; of a task that was evaluated in several ways, of each of these.
    """
    shown = {task: pd.DataFrame(failures) for task, failures in found.items() if failures}
    without = [task for task in found if task not in shown]
    rows = max(1, -(-len(shown) // COLUMNS))
    figure = new_figure(
        1.7 * rows + 1.2,
        "At which keypose failed episodes were lost, and by which arm",
        "Across: index of the last keypose before which the expert could still solve the episode.",
        *([f"No failed episode: {', '.join(without)}"] if without else []),
    )
    panels = figure.subplots(rows, COLUMNS, squeeze=False).flatten()
    for panel, (task, failures) in zip(panels, shown.items(), strict=False):
        _draw(panel, task, failures)
    for panel in panels[len(shown) :]:
        panel.set_axis_off()
    if shown:
        panels[0].legend(fontsize=6)
    said = dict.fromkeys(found, "0 failed") | {
        task: ", ".join(
            [f"{len(failures)} failed"]
            + [f"{count} by {name}" for name, count in failures.groupby("responsible").size().items()]
        )
        for task, failures in shown.items()
    }
    return Chart(figure, " ".join(f"{task}: {text}." for task, text in said.items()))


def _draw(panel: Axes, task: str, failures: pd.DataFrame) -> None:
    counts = pd.crosstab(failures.last_recoverable, failures.responsible)
    last = int(max(counts.index, default=0))
    counts = counts.reindex(index=range(last + 1), columns=[*COLORS], fill_value=0)
    style = {"edgecolor": INK, "linewidth": 0.6, "width": 0.8, "legend": False, "rot": 0}
    counts.plot.bar(ax=panel, stacked=True, color=COLORS, **style)
    unattributed = len(failures) - int(counts.to_numpy().sum())
    note = f", {unattributed} not attributed" if unattributed else ""
    panel.set_title(f"{task}\n{len(failures)} failed{note}", fontsize=8)
    panel.set(xlim=(-0.6, max(last, 4) + 0.6), ylim=(0, max(1, counts.sum(axis=1).max())), xlabel="")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.xaxis.set_major_formatter("{x:.0f}")
    panel.yaxis.set_major_locator(MaxNLocator(nbins=3, integer=True))
    panel.grid(axis="y")
    panel.set_axisbelow(True)
    panel.tick_params(length=0)
