"""The picture of many results: success of every policy on every task, beside the expert and the blind control."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.canvas import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    VERMILION,
    WIDTH,
    Canvas,
    Color,
    Mark,
)
from lerobot_bimanual.results.statistics import SuccessRate, wilson_interval

STYLES: tuple[tuple[Mark, Color], ...] = (
    ("circle", BLUE),
    ("square", VERMILION),
    ("diamond", GREEN),
    ("triangle", PURPLE),
    ("circle", ORANGE),
)
"""Of policies in the order of their names, in turns; each line also bears its policy's name."""
LEFT, RIGHT = 210, WIDTH - 130
"""Where 0 % and 100 % are."""
TOP, LINE, GAP, MARGIN = 96, 22, 14, 16
OF_EPISODES = "Line: 95 % Wilson interval, for which episodes were drawn."
SINGLE = "Each policy was trained once, which does not say how far another training would be from it."
SEVERAL = "Hollow: single trainings; filled: their mean. A policy without hollow marks was trained once."
MOST_COUNTS = 3
"""Of trainings whose successes are written out beside their line."""


@dataclass(frozen=True)
class _Line:
    """Who played, and how often who succeeded in each training; expert and control are one."""

    who: str
    rates: tuple[SuccessRate, ...]
    mark: Mark
    color: Color

    @property
    def mean(self) -> float:
        return sum(rate.rate for rate in self.rates) / len(self.rates)

    @property
    def interval(self) -> tuple[float, float]:
        """Of the mean, had a single policy of this rate played the episodes; trainings share theirs."""
        trials = min(rate.trials for rate in self.rates)
        return wilson_interval(self.mean * trials, trials)

    @property
    def counts(self) -> str:
        trials = self.rates[0].trials
        if len(self.rates) > MOST_COUNTS:
            return f"{self.mean:.0%} of {trials}, {len(self.rates)} times"
        return f"{', '.join(str(rate.successes) for rate in self.rates)} of {trials}"


def success_figure(rows: Sequence[ResultRow]) -> Canvas:
    """One group of lines per task: its policies, the expert and the blind control.

    Args:
        rows: alike, as `check_likeness` has it.
    """
    lines = _lines(rows)
    count = sum(map(len, lines.values()))
    height = TOP + count * LINE + len(lines) * (LINE + GAP) + 2 * MARGIN
    said = ("; ".join(f"{line.who} {line.counts}" for line in group) for group in lines.values())
    description = "Successes. " + " ".join(
        f"{place}: {group}." for place, group in zip(lines, said, strict=True)
    )
    canvas = Canvas(height, description)
    canvas.text(MARGIN, 24, "Success on unseen episodes", size=20)
    single = all(len(line.rates) == 1 for group in lines.values() for line in group)
    for number, text in enumerate((OF_EPISODES, SINGLE if single else SEVERAL)):
        canvas.text(MARGIN, 48 + 18 * number, text, GREY, 12)
    _draw_axis(canvas, TOP - 10, height - 2 * MARGIN)
    y = TOP + LINE / 2
    for place, group in lines.items():
        canvas.text(MARGIN, y, place, size=14, room=WIDTH - 2 * MARGIN)
        for line in group:
            y += LINE
            _draw_line(canvas, y, line)
        y += LINE + GAP
    return canvas


def _lines(rows: Sequence[ResultRow]) -> dict[str, list[_Line]]:
    """By task; the trainings of a policy in the order of their seeds."""
    styles = dict(zip(sorted({row.learner for row in rows}), _in_turns(), strict=False))
    trained: defaultdict[str, defaultdict[str, list[ResultRow]]] = defaultdict(lambda: defaultdict(list))
    for row in sorted(rows, key=lambda row: (row.place, row.learner)):
        trained[row.place][row.learner].append(row)
    lines: dict[str, list[_Line]] = {}
    for place, policies in trained.items():
        group = lines[place] = []
        for policy, trainings in policies.items():
            trainings.sort(key=lambda row: int(row.flags["seed"]))
            rates = tuple(row.rates["policy"] for row in trainings)
            group.append(_Line(policy, rates, *styles[policy]))
        beside = next(iter(policies.values()))[0].rates
        group.append(_Line("expert", (beside["expert"],), "triangle", INK))
        group.append(_Line("blind", (beside["blind"],), "cross", GREY))
    return lines


def _in_turns() -> Iterator[tuple[Mark, Color]]:
    while True:
        yield from STYLES


def _draw_axis(canvas: Canvas, top: float, bottom: float) -> None:
    for percent in range(0, 101, 20):
        x = _x(percent / 100)
        canvas.line((x, top), (x, bottom), PALE)
        canvas.text(x, bottom + 12, f"{percent}%", GREY, 12, "mm")


def _draw_line(canvas: Canvas, y: float, line: _Line) -> None:
    canvas.text(LEFT - MARGIN, y, line.who, line.color, anchor="rm", room=LEFT - 2 * MARGIN)
    low, high = map(_x, line.interval)
    canvas.line((low, y), (high, y), line.color, 2.5)
    canvas.mark(line.mark, _x(line.mean), y, line.color)
    if len(line.rates) > 1:
        for rate in line.rates:
            canvas.mark(line.mark, _x(rate.rate), y - 8, line.color, 3, hollow=True)
    canvas.text(RIGHT + MARGIN, y, line.counts, line.color, room=WIDTH - RIGHT - MARGIN)


def _x(share: float) -> float:
    return LEFT + share * (RIGHT - LEFT)
