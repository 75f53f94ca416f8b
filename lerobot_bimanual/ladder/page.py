"""Ladders and certificates of rungs as parts of a page."""

from collections.abc import Iterator, Mapping, Sequence

from lerobot_bimanual.ladder.falls import Fall, falls, level_sums
from lerobot_bimanual.ladder.result import (
    LEAST_EXPERT_RATE,
    LEVEL_0,
    AxisRecord,
    LadderResult,
    rung_name,
    short_name,
)
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.statistics import SuccessRate

UPPER_LEVELS = range(1, MAX_LEVEL + 1)
SURE = 0.05
HEADING = "# What policies survive\n"
HEADING_OF_CERTIFICATES = "# Where experts still succeed\n"
LEGEND = (
    "Per task, policies side by side: episodes solved at levels 1, 2 and 3 of each axis, and above them at level 0. In bold: "
    "differs from level 0 on the same episodes, McNemar's exact test with p up to 0.05 as corrected by Holm for how many axes "
    "have a certified rung of that level. In brackets: not certified, since the expert solves less than "
    f"{LEAST_EXPERT_RATE:.0%}; counted in no sum. A point: not played.\n"
)
"""Of the tables of ladders."""
LEGEND_OF_CERTIFICATES = (
    "A rung is certified if the expert solves at least "
    f"{LEAST_EXPERT_RATE:.0%} of its episodes. The first table counts tasks; in those of a task a field says what the expert and "
    "the blind control solve, in brackets where the rung is not certified.\n"
)


def ladders_page(ladders: Mapping[str, LadderResult]) -> str:
    """A section per task: successes of its policies at each level of each axis, and what is lost against level 0.

    Args:
        ladders: by name.
    """
    by_task: dict[str, dict[str, LadderResult]] = {}
    for name, ladder in ladders.items():
        by_task.setdefault(ladder.task, {})[name] = ladder
    sections = (*_all_tasks(ladders), *("\n".join(_task(task, by_task[task])) for task in sorted(by_task)))
    return "\n".join(sections)


def _all_tasks(ladders: Mapping[str, LadderResult]) -> Iterator[str]:
    """Success on each rung over the tasks where it is certified, of every policy that has a ladder on several."""
    of_policy: dict[str, list[LadderResult]] = {}
    for name, ladder in ladders.items():
        of_policy.setdefault(short_name(name, ladder), []).append(ladder)
    several = {name: found for name, found in of_policy.items() if len({each.task for each in found}) > 1}
    if not several:
        return
    yield "### All tasks\n"
    yield (
        "Percent of the episodes solved at levels 1, 2 and 3, over the tasks of a policy where the rung is certified and the axis "
        "has anything to change; above them at level 0, over all its tasks.\n"
    )
    axes = sorted(
        {(axis.group, axis.name) for found in several.values() for each in found for axis in each.axes}
    )
    rows = [["level 0", *(_share(found, LEVEL_0) for found in several.values())]]
    for _, axis in axes:
        rungs = [rung_name(axis, level) for level in UPPER_LEVELS]
        rows.append([axis, *(" ".join(_share(found, rung) for rung in rungs) for found in several.values())])
    yield (
        markdown_table(["axis", *(f"{name}, {len(found)} tasks" for name, found in several.items())], rows)
        + "\n"
    )


def _share(ladders: Sequence[LadderResult], name: str) -> str:
    """Percent solved of the episodes of a rung where it is certified; a point where it is nowhere."""
    rungs = [ladder.by_name[name] for ladder in ladders if name in ladder.by_name]
    rates = [rung.rates["policy"] for rung in rungs if rung.is_certified]
    if not rates:
        return "."
    return f"{sum(rate.successes for rate in rates) / sum(rate.trials for rate in rates):.0%}"


def _task(task: str, ladders: Mapping[str, LadderResult]) -> Iterator[str]:
    yield f"### {task}\n"
    found = {name: falls(ladder) for name, ladder in ladders.items()}
    axes = {(axis.group, axis.name, _magnitudes(axis)) for ladder in ladders.values() for axis in ladder.axes}
    rows = [["level 0", *(_of(ladder.level_0.rates["policy"]) for ladder in ladders.values())]]
    for _, axis, magnitudes in sorted(axes):
        rungs = [f"{axis}:{level}" for level in UPPER_LEVELS]
        played = [axis in (each.name for each in ladder.axes) for ladder in ladders.values()]
        cells = [
            " ".join(_cell(found[name].get(rung)) for rung in rungs) if has_axis else ""
            for name, has_axis in zip(ladders, played, strict=True)
        ]
        rows.append([f"{axis} ({magnitudes})", *cells])
    for level in UPPER_LEVELS:
        sums = [level_sums(ladder).get(level) for ladder in ladders.values()]
        rows.append([f"certified rungs of level {level}", *(_of(rate) if rate else "" for rate in sums)])
    short = [short_name(name, ladder) for name, ladder in ladders.items()]
    yield markdown_table(["axis", *short], rows) + "\n"
    for name, ladder in ladders.items():
        rates, seeds = ladder.level_0.rates, ladder.level_0.seeds
        yield (
            f"- {name}: {ladder.policy}, weights {ladder.checkpoint_sha256[:12]}, {ladder.options['split']} seeds {seeds[0]} "
            f"to {seeds[-1]}, batches of {ladder.batch_size}; at level 0 expert {_of(rates['expert'])}, blind "
            f"{_of(rates['blind'])}."
        )
    without = sorted({axis for ladder in ladders.values() for axis in ladder.not_applicable})
    yield f"\nNot applicable: {', '.join(without)}.\n" if without else ""


def _magnitudes(axis: AxisRecord) -> str:
    return f"{', '.join(f'{magnitude:g}' for magnitude in axis.magnitudes)} {axis.unit}"


def _of(rate: SuccessRate) -> str:
    return f"{rate.successes} of {rate.trials}"


def _cell(fall: Fall | None) -> str:
    """Successes; in bold where they differ from level 0; in brackets where the rung is not certified."""
    if fall is None:
        return "."
    solved = str(fall.rung.rates["policy"].successes)
    if fall.p_holm is None:
        return f"({solved})"
    return f"**{solved}**" if fall.p_holm <= SURE else solved


def certificates_page(certificates: Mapping[str, RungCertificate]) -> str:
    """On how many tasks each rung is certified; then, per task, what expert and blind control solve on every rung.

    Args:
        certificates: by task.
    """
    parts = (
        *_overview(certificates),
        *_looking_again(certificates),
        *("\n".join(_certificate(each)) for each in certificates.values()),
    )
    return "\n".join(parts)


def _overview(certificates: Mapping[str, RungCertificate]) -> Iterator[str]:
    yield LEGEND_OF_CERTIFICATES
    yield "### Certified tasks\n"
    names = sorted({axis.name for certificate in certificates.values() for axis in certificate.axes})
    rows = [
        [name, *(_certified_tasks(certificates, name, level) for level in UPPER_LEVELS)] for name in names
    ]
    yield markdown_table(["axis", *(f"level {level}" for level in UPPER_LEVELS)], rows) + "\n"


def _looking_again(certificates: Mapping[str, RungCertificate]) -> Iterator[str]:
    """On rungs where things are moved later: who reads the scene again beside who planned at the reset."""
    asked = [
        (task, certificate, rung)
        for task, certificate in certificates.items()
        for rung in certificate.rungs
        if rung.planned_failed is not None
    ]
    if not asked:
        return
    yield "### Looking again\n"
    yield (
        "Where things are moved while an episode runs: what is solved by the expert who reads the scene again after that, then "
        "by the one who planned at the reset.\n"
    )
    axes = sorted({rung.axis for _, _, rung in asked})
    cells: dict[tuple[str, str], list[str]] = {}
    for task, certificate, rung in asked:
        rates = certificate.rates(rung)
        cells.setdefault((rung.axis, task), [""] * MAX_LEVEL)[rung.level - 1] = (
            f"{_of(rates['expert'])}, {_of(rates['planned_at_reset'])}"
        )
    for axis in axes:
        rows = [[task, *levels] for (name, task), levels in cells.items() if name == axis]
        yield markdown_table([axis, *(f"level {level}" for level in UPPER_LEVELS)], rows) + "\n"


def _certified_tasks(certificates: Mapping[str, RungCertificate], axis: str, level: int) -> str:
    """Of the tasks that have the rung, how many are certified; in brackets those that are not."""
    found = {
        task: certificate.is_certified(rung)
        for task, certificate in certificates.items()
        if (rung := certificate.find(axis, level)) is not None
    }
    without = [task for task, is_certified in found.items() if not is_certified]
    counts = f"{len(found) - len(without)} of {len(found)}" if found else ""
    return f"{counts} (not {', '.join(without)})" if without else counts


def _certificate(certificate: RungCertificate) -> Iterator[str]:
    expert, blind = (f"{start}:{stop}" for start, stop in (certificate.expert_seeds, certificate.blind_seeds))
    level_0 = certificate.rates(certificate.rungs[0])
    yield f"### {certificate.task}\n"
    yield (
        f"Expert on {certificate.split} seeds {expert}, blind control on {blind}. Level 0: expert {level_0['expert']}, blind "
        f"{level_0['blind']}.\n"
    )
    rows = []
    for axis in certificate.axes:
        cells = [_counts(certificate, certificate.find(axis.name, level)) for level in UPPER_LEVELS]
        rows.append([f"{axis.name} ({_magnitudes(axis)})", *cells])
    yield markdown_table(["axis", *(f"level {level}" for level in UPPER_LEVELS)], rows) + "\n"
    if certificate.not_applicable:
        yield f"Not applicable: {', '.join(certificate.not_applicable)}.\n"


def _counts(certificate: RungCertificate, rung: CertifiedRung | None) -> str:
    """Expert and blind control, each of how many; in brackets where the expert solves too few."""
    if rung is None:
        return ""
    rates = certificate.rates(rung)
    text = ", ".join(f"{rates[who].successes}/{rates[who].trials}" for who in ("expert", "blind"))
    return text if certificate.is_certified(rung) else f"({text})"
