"""Chart of many results: success of every policy on every task, beside the expert and the open-loop baseline."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import cycle
from pathlib import Path
from statistics import fmean

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lerobot_bimanual.files import write_file
from lerobot_bimanual.reports.benchmark_page import results_table
from lerobot_bimanual.results.benchmark import Scored
from lerobot_bimanual.results.statistics import SuccessRate, wilson_interval

INK, GREY, PALE = "#202228", "#70747e", "#dee0e5"
BLUE, ORANGE, GREEN, PURPLE, VERMILION, SKY = "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9"
"""Of Okabe and Ito, which the colour-blind tell apart and which differ in grey, too."""
WIDTH_IN, DPI = 8.0, 150
STYLES = [*zip("osD^vP", (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY), strict=True)]
"""Markers and colours of policies in the order of their names, in turns."""
BASELINES = (("expert", "expert", "^", INK), ("open_loop", "open loop", "x", GREY))
"""Key of the rate, label, marker and colour."""
LINE_IN = 0.062
GAP = 2
"""Lines between tasks."""
MARGIN_IN = 1.2
EPISODES = "Line: 95 % Wilson interval, for which episodes were drawn."
ONE_TRAINING = "Each policy was trained once, which does not say how far another training would be from it."
TRAININGS = "Hollow: single trainings; filled: their mean. A policy without hollow marks was trained once."
MAX_COUNTS = 3
"""Trainings whose successes the description lists."""

styled = matplotlib.rc_context(fname=Path(__file__).with_name("success.mplstyle"))
"""Decorates what draws."""


@dataclass(frozen=True)
class Chart:
    """A drawn figure.

    Attributes:
        figure: as matplotlib has it.
        description: what is drawn, in words, for readers who cannot see it.
    """

    figure: Figure
    description: str

    def save(self, path: Path) -> None:
        """Write a PNG file that holds the description.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        file = BytesIO()
        metadata = {"Description": self.description, "Software": None}
        self.figure.savefig(file, format="png", dpi=DPI, metadata=metadata, pil_kwargs={"optimize": True})
        write_file(path, file.getvalue())


@styled
def success_figure(rows: Sequence[Scored]) -> Chart:
    """One group of lines per task: its policies, the expert and the open-loop baseline.

    Args:
        rows: comparable results.
    """
    table = results_table(rows)
    trained, tasks = table.groupby(["task", "policy"]).ngroups, table.task.nunique()
    height_in = LINE_IN * (trained + (len(BASELINES) + GAP) * tasks) + MARGIN_IN
    note = TRAININGS if len(table) > trained else ONE_TRAINING
    figure = Figure(figsize=(WIDTH_IN, height_in))
    figure.supxlabel(f"{EPISODES}\n{note}", x=0.01, ha="left", fontsize=8, color=GREY)
    panel = figure.subplots()
    styles = dict(zip(sorted(table.policy.unique()), cycle(STYLES), strict=False))
    y, labels, said = 0.0, {}, ["Successes."]
    for task, of_task in table.groupby("task"):
        lines = {name: ([*rates], *styles[name]) for name, rates in of_task.groupby("policy").rate}
        baselines = {label: ([of_task[key].iloc[0]], *style) for key, label, *style in BASELINES}
        lines |= {label: line for label, line in baselines.items() if line[0] != [None]}
        labels[y + (len(lines) - 1) / 2] = task
        counts = []
        for name, (rates, marker, color) in lines.items():
            counts.append(f"{name} {_draw(panel, y, rates, marker, color)}")
            y += 1
        said.append(f"{task}: {'; '.join(counts)}.")
        y += GAP
    panel.set(xlim=(-0.02, 1.02), ylim=(y - GAP, -1))
    panel.set_yticks([*labels], [*labels.values()])
    names = styles | {label: style for _, label, *style in BASELINES}
    marks = [
        Line2D([], [], marker=marker, color=color, label=name) for name, (marker, color) in names.items()
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=4, frameon=False)
    panel.xaxis.set_major_formatter("{x:.0%}")
    panel.grid(axis="x")
    panel.spines[["left", "bottom"]].set_visible(False)
    panel.tick_params(length=0)
    return Chart(figure, " ".join(said))


def _draw(panel: Axes, y: float, rates: Sequence[SuccessRate], marker: str, color: str) -> str:
    """Draw the success of each training of a policy, and say its counts.

    The interval is that of the mean, as if one policy of this rate had played the episodes that trainings share.
    """
    shares, trials = [rate.rate for rate in rates], min(rate.trials for rate in rates)
    mean = fmean(shares)
    panel.hlines(y, *wilson_interval(mean * trials, trials), color, linewidth=1.2)
    panel.plot(mean, y, marker, color=color, markersize=4, clip_on=False)
    if len(rates) > 1:
        single = {"fillstyle": "none", "markersize": 2.5, "clip_on": False}
        panel.plot(shares, [y - 0.38] * len(shares), marker, color=color, **single)
    counts = f"{', '.join(str(rate.successes) for rate in rates)} of {rates[0].trials}"
    if len(rates) > MAX_COUNTS:
        counts = f"{mean:.0%} of {rates[0].trials}, {len(rates)} times"
    return counts
