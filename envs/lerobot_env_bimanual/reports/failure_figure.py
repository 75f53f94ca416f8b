"""Chart of failed episodes: at which keypose they were lost, and by which arm."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

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
    shown = {task: failures for task, failures in found.items() if failures}
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
    return Chart(figure, " ".join(_sentence(task, failures) for task, failures in found.items()))


def _draw(panel: Axes, task: str, failures: Sequence[Attribution]) -> None:
    counts = Counter((failure.last_recoverable, failure.responsible) for failure in failures)
    last = max((index for index, _ in counts if index is not None), default=0)
    bottom = [0] * (last + 1)
    style = {"edgecolor": INK, "linewidth": 0.6}
    for responsible, color in COLORS.items():
        heights = [counts[index, responsible] for index in range(last + 1)]
        panel.bar(range(last + 1), heights, bottom=bottom, color=color, label=responsible, **style)
        bottom = [below + height for below, height in zip(bottom, heights, strict=True)]
    unattributed = len(failures) - sum(bottom)
    note = f", {unattributed} not attributed" if unattributed else ""
    panel.set_title(f"{task}\n{len(failures)} failed{note}", fontsize=8)
    panel.set(xlim=(-0.6, max(last, 4) + 0.6), ylim=(0, max(1, *bottom)))
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.yaxis.set_major_locator(MaxNLocator(nbins=3, integer=True))
    panel.grid(axis="y")
    panel.set_axisbelow(True)
    panel.tick_params(length=0)


def _sentence(task: str, failures: Sequence[Attribution]) -> str:
    counts = Counter(failure.responsible for failure in failures)
    parts = [f", {count} by {responsible}" for responsible, count in sorted(counts.items())]
    return f"{task}: {len(failures)} failed{''.join(parts)}."
