"""Chart of many results: success of every policy on every task, beside the expert and the open-loop baseline."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle

from matplotlib.axes import Axes

from lerobot_bimanual.reports import charts
from lerobot_bimanual.reports.charts import GREY, INK, Chart, new_figure, styled
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.statistics import SuccessRate, wilson_interval

STYLES = [
    *zip("osD^o", (charts.BLUE, charts.VERMILION, charts.GREEN, charts.PURPLE, charts.ORANGE), strict=True)
]
"""Markers and colours of policies in the order of their names, in turns; each line also bears its policy's name."""
BASELINES = (("expert", "expert", "^", INK), ("open_loop", "open loop", "x", GREY))
"""Key of the rate, label, marker and colour."""
LINE_IN = 0.2
EPISODES = "Line: 95 % Wilson interval, for which episodes were drawn."
ONE_TRAINING = "Each policy was trained once, which does not say how far another training would be from it."
TRAININGS = "Hollow: single trainings; filled: their mean. A policy without hollow marks was trained once."
MAX_COUNTS = 3
"""Trainings whose successes are written out beside their line."""


@dataclass(frozen=True)
class _Line:
    """A policy or baseline on one task: its success in each training."""

    label: str
    rates: tuple[SuccessRate, ...]
    marker: str
    color: str

    @property
    def mean(self) -> float:
        return sum(rate.rate for rate in self.rates) / len(self.rates)

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson interval of the mean, as if one policy of this rate had played the episodes that trainings share."""
        trials = min(rate.trials for rate in self.rates)
        return wilson_interval(self.mean * trials, trials)

    @property
    def counts(self) -> str:
        trials = self.rates[0].trials
        if len(self.rates) > MAX_COUNTS:
            return f"{self.mean:.0%} of {trials}, {len(self.rates)} times"
        return f"{', '.join(str(rate.successes) for rate in self.rates)} of {trials}"


@styled
def success_figure(rows: Sequence[BenchmarkResult]) -> Chart:
    """One group of lines per task: its policies, the expert and the open-loop baseline.

    Args:
        rows: comparable results.
    """
    groups = dict(_groups(rows))
    lines = [line for group in groups.values() for line in group]
    note = TRAININGS if any(len(line.rates) > 1 for line in lines) else ONE_TRAINING
    figure = new_figure(
        LINE_IN * (len(lines) + 1.6 * len(groups) + 4), "Success on unseen episodes", EPISODES, note
    )
    panel = figure.subplots()
    y, labels = 0.0, {}
    for task, group in groups.items():
        labels[y] = (task, INK, "bold")
        for line in group:
            y += 1
            labels[y] = (line.label, line.color, "normal")
            _draw(panel, y, line)
        y += 1.6
    panel.set(xlim=(-0.02, 1.02), ylim=(y - 1, -0.6))
    panel.set_yticks([*labels], [text for text, *_ in labels.values()])
    for label, (_, color, weight) in zip(panel.get_yticklabels(), labels.values(), strict=True):
        label.set(color=color, fontweight=weight)
    panel.xaxis.set_major_formatter("{x:.0%}")
    panel.grid(axis="x")
    panel.spines[["left", "bottom"]].set_visible(False)
    panel.tick_params(length=0)
    said = {
        task: "; ".join(f"{line.label} {line.counts}" for line in group) for task, group in groups.items()
    }
    return Chart(figure, "Successes. " + " ".join(f"{task}: {text}." for task, text in said.items()))


def _groups(rows: Sequence[BenchmarkResult]) -> Iterator[tuple[str, list[_Line]]]:
    """Lines by task; trainings of a policy in the order of their seeds."""
    policies = sorted({row.config.policy_id for row in rows})
    styles = dict(zip(policies, cycle(STYLES), strict=False))
    trained = defaultdict(list)
    for row in sorted(rows, key=lambda row: row.config.seed):
        trained[row.config.eval_key, row.config.policy_id].append(row.rates)
    for task in sorted({row.config.eval_key for row in rows}):
        found = {policy: trained[task, policy] for policy in policies if (task, policy) in trained}
        lines = [
            _Line(policy, tuple(rates["policy"] for rates in trainings), *styles[policy])
            for policy, trainings in found.items()
        ]
        rates = next(iter(found.values()))[0]
        yield task, lines + [_Line(label, (rates[key],), *style) for key, label, *style in BASELINES]


def _draw(panel: Axes, y: float, line: _Line) -> None:
    low, high = line.interval
    panel.hlines(y, low, high, line.color, linewidth=1.8)
    panel.plot(line.mean, y, line.marker, color=line.color, markersize=5, clip_on=False)
    if len(line.rates) > 1:
        shares, above = [rate.rate for rate in line.rates], [y - 0.38] * len(line.rates)
        single = {"fillstyle": "none", "markersize": 3, "clip_on": False}
        panel.plot(shares, above, line.marker, color=line.color, **single)
    panel.text(1.04, y, line.counts, color=line.color, va="center", fontsize=8)
