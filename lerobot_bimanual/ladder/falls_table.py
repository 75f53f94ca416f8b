"""The rungs of one ladder as a table, and what is to be said below it."""

from collections.abc import Iterator

from lerobot_bimanual.ladder.falls import falls, level_sums
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.terminal_table import print_table

HEADINGS = ("rung", "magnitude", "policy", "95 % interval", "expert", "blind", "lost, won", "p", "p (Holm)")


def print_falls(result: LadderResult) -> None:
    """One line per rung; lost and won are the episodes that only level 0, and only the rung, saw solved."""
    rows = []
    found, axes = falls(result), {axis.name: axis for axis in result.axes}
    for rung in result.rungs:
        rates, axis, fall = rung.rates, axes.get(rung.axis), found.get(rung.name)
        low, high = rates["policy"].interval
        paired = ("", "", "")
        if fall is not None:
            p_holm = "not certified" if fall.p_holm is None else f"{fall.p_holm:.3g}"
            changed = f"{fall.pairing.only_first}, {fall.pairing.only_second}"
            paired = (changed, f"{fall.p_value:.3g}", p_holm)
        rows.append(
            (
                rung.name,
                "" if axis is None else f"{axis.magnitudes[rung.level - 1]:g}",
                rates["policy"].successes,
                f"{low:.0%} to {high:.0%}",
                rates["expert"].successes,
                rates["blind"].successes,
                *paired,
            )
        )
    title = f"{result.policy} on {result.task}, the same {len(result.level_0.episodes)} episodes"
    print_table(HEADINGS, rows, title)


def remarks(result: LadderResult) -> Iterator[str]:
    """Sums over certified rungs, and what is in no sum."""
    sums = level_sums(result)
    said = (f"level {level}: {rate.successes} of {rate.trials}" for level, rate in sums.items())
    yield f"certified rungs together: {'; '.join(said) or 'none'}"
    if doubtful := [rung.name for rung in result.rungs if not rung.is_certified]:
        yield f"not certified, counted nowhere: {', '.join(doubtful)}"
    if result.not_applicable:
        yield f"not applicable to {result.task}: {', '.join(result.not_applicable)}"
