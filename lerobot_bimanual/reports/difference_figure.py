"""Chart of two policies: by how much one is better on each task, and how certain that is."""

from collections.abc import Iterable, Mapping

from lerobot_bimanual.reports.charts import BLUE, GREY, INK, ORANGE, Chart, new_figure, styled
from lerobot_bimanual.reports.robustness_table import SIGNIFICANT
from lerobot_bimanual.results.comparison import Comparison
from lerobot_bimanual.results.statistics import holm

NOTES = (
    "Blue: one standard error, for which episodes were drawn. Orange, below it: one standard error, for which trainings",
    f"there were; it needs two of each policy. Filled: p (Holm) up to {SIGNIFICANT}. In brackets the number of shared episodes.",
)
COLUMNS = ((60, "better on"), (110, "p"), (165, "p (Holm)"))
"""Right edges, in points from the chart, and headings of the columns beside it."""


@styled
def difference_figure(comparisons: Mapping[str, Comparison]) -> Chart:
    """One line per task, by name: the difference with its errors, on how many episodes either is better, and p-values."""
    corrected = holm([comparison.p_value for comparison in comparisons.values()])
    one = next(iter(comparisons.values()))
    subject = f"first ({one.first[0].config.policy}) less second ({one.second[0].config.policy})"
    tests = " or ".join(sorted({comparison.test for comparison in comparisons.values()}))
    figure = new_figure(
        0.35 * len(comparisons) + 1.8,
        f"Success on the same episodes: {subject}",
        *NOTES,
        f"p is that of {tests}.",
    )
    panel = figure.subplots()

    def write(y: float, texts: Iterable[str], color: str) -> None:
        for (right, _), text in zip(COLUMNS, texts, strict=True):
            panel.annotate(
                text,
                (1, y),
                (right, 0),
                xycoords=panel.get_yaxis_transform(),
                textcoords="offset points",
                ha="right",
                va="center",
                color=color,
            )

    write(-0.8, (heading for _, heading in COLUMNS), GREY)
    for y, (comparison, p_holm) in enumerate(zip(comparisons.values(), corrected, strict=True)):
        x = comparison.difference
        panel.errorbar(x, y, xerr=comparison.episode_error, color=BLUE, linewidth=1.8)
        if comparison.training_error is not None:
            panel.errorbar(x, y + 0.2, xerr=comparison.training_error, color=ORANGE, linewidth=1.8)
        face = BLUE if p_holm <= SIGNIFICANT else "white"
        panel.plot(x, y, "o", markeredgecolor=BLUE, markerfacecolor=face, markersize=6)
        better = "{}, {}".format(*comparison.better)
        write(y, (better, f"{comparison.p_value:.2g}", f"{p_holm:.2g}"), INK)
    reach = max(0.1, *map(abs, panel.get_xlim()))
    panel.axvline(0, color=GREY, linewidth=0.8)
    panel.set(xlim=(-reach, reach), ylim=(len(comparisons) - 0.4, -0.6))
    panel.set_yticks(
        range(len(comparisons)),
        [f"{task} ({len(comparison.seeds)})" for task, comparison in comparisons.items()],
    )
    panel.xaxis.set_major_formatter("{x:+.0%}")
    panel.grid(axis="x")
    panel.tick_params(length=0)
    said = (
        f"{task}: {comparison.difference:+.1%}, p (Holm) {p_holm:.3g}."
        for (task, comparison), p_holm in zip(comparisons.items(), corrected, strict=True)
    )
    return Chart(figure, f"Success, {subject}. {' '.join(said)}")
