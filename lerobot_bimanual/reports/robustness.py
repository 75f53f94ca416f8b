"""A robustness result on the terminal, a line per condition; and the page of the experts, which says where conditions are valid."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from collections.abc import Mapping
from typing import Any

import pandas as pd

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.pages import render
from lerobot_bimanual.perturbation_levels import LEVELS
from lerobot_bimanual.results.robustness import (
    MIN_EXPERT_RATE,
    ExpertRobustnessReport,
    RobustnessResult,
    is_valid,
)
from lerobot_bimanual.results.statistics import holm, paired_p_value
from lerobot_bimanual.terminal import print_table, say


def conditions_table(result: RobustnessResult) -> pd.DataFrame:
    """One line per condition.

    Returns:
        Columns `condition`, `level`, `magnitude`, `n` (episodes), `solved`, `interval` (95 %, of the rate, as text),
        `expert` and `open_loop` (episodes solved), `valid`, and beside the nominal world `lost`, `won` (episodes), `p`
        (McNemar's exact test) and `p_holm` (corrected by Holm for the number of axes with a valid condition of the same
        level; NaN if the condition is not valid).
    """
    lines, axes = [], {axis.name: axis for axis in result.axes}
    for each in result.conditions:
        rates, axis = each.rates, axes.get(each.axis)
        here, nominal = ([episode.success for episode in of.episodes] for of in (each, result.nominal))
        changes = [now - before for now, before in zip(here, nominal, strict=True)]
        lines.append(
            {
                "condition": each.name,
                "level": each.level,
                "magnitude": axis.magnitudes[each.level - 1] if axis else None,
                "n": len(each.episodes),
                "solved": rates["policy"].successes,
                "interval": "{:.0%} to {:.0%}".format(*rates["policy"].interval),
                "expert": rates["expert"].successes,
                "open_loop": rates["open_loop"].successes,
                "valid": each.is_valid,
                "lost": changes.count(-1),
                "won": changes.count(1),
                "p": paired_p_value(here, nominal) if axis else None,
            }
        )
    table = pd.DataFrame(lines)
    tested = table[(table.level > 0) & table.valid]
    table["p_holm"] = tested.groupby("level").p.transform(lambda p: holm([*p]))
    return table


def print_robustness(result: RobustnessResult) -> None:
    """Print a line per condition, and what the conditions together say.

    Lost and won are the episodes that are solved only in the nominal world, and only on the condition.
    """
    table = conditions_table(result)
    shown = pd.DataFrame(
        {
            "condition": line.condition,
            "magnitude": f"{line.magnitude:g}" if line.level else "",
            "policy": line.solved,
            "95 % interval": line.interval,
            "expert": line.expert,
            "open loop": line.open_loop,
            "lost, won": f"{line.lost}, {line.won}" if line.level else "",
            "p": f"{line.p:.3g}" if line.level else "",
            "p (Holm)": _corrected_text(line) if line.level else "",
        }
        for line in table.itertuples()
    )
    print_table(
        shown, f"{result.config.policy} on {result.task}, the same {len(result.nominal.episodes)} episodes"
    )
    sums = table[table.valid].groupby("level")[["solved", "n"]].sum()
    said = "; ".join(f"level {line.Index}: {line.solved} of {line.n}" for line in sums.itertuples())
    say(f"valid conditions together: {said or 'none'}")
    if not table.valid.all():
        invalid = ", ".join(table[~table.valid].condition)
        say(f"not valid (the expert solves too few episodes) and left out of the sums: {invalid}")
    if result.not_applicable:
        say(f"not applicable to {result.task}: {', '.join(result.not_applicable)}")


def _corrected_text(line: Any) -> str:
    return f"{line.p_holm:.3g}" if line.valid else "not valid"


def expert_robustness_page(reports: Mapping[str, ExpertRobustnessReport]) -> str:
    """On how many tasks each condition is valid, from the report of each.

    Raises:
        BimanualError: no report has a perturbed condition.
    """
    table = pd.DataFrame(
        {
            "task": task,
            "axis": each.axis,
            "level": each.level,
            "valid": is_valid(report.rates(each)["expert"]),
        }
        for task, report in reports.items()
        for each in report.conditions[1:]
    )
    if table.empty:
        raise BimanualError(
            "the expert was reported in the nominal world alone; `lerobot-bimanual expert evaluate --axes=all` perturbs it"
        )
    overview = pd.Series({key: _valid_tasks(lines) for key, lines in table.groupby(["axis", "level"])})
    cells = overview.unstack().reindex(columns=LEVELS).fillna("")
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=MIN_EXPERT_RATE,
        overview=cells.add_prefix("level ").rename_axis("axis").reset_index(),
    )


def _valid_tasks(lines: pd.DataFrame) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    counts = f"{lines.valid.sum()} of {len(lines)}"
    return counts if lines.valid.all() else f"{counts} (not {', '.join(lines.task[~lines.valid])})"
