"""Certificates of rungs as parts of a page."""

from collections.abc import Iterator, Mapping

from lerobot_bimanual.ladder.ladders_page import UPPER_LEVELS, counts_text, magnitudes_text
from lerobot_bimanual.ladder.result import LEAST_EXPERT_RATE
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.perturbation_levels import MAX_LEVEL

HEADING = "# Where experts still succeed\n"
LEGEND = (
    "A rung is certified if the expert solves at least "
    f"{LEAST_EXPERT_RATE:.0%} of its episodes. The first table counts tasks; in those of a task a field says what the expert and "
    "the blind control solve, in brackets where the rung is not certified.\n"
)


def render(certificates: Mapping[str, RungCertificate]) -> str:
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
    yield LEGEND
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
            f"{counts_text(rates['expert'])}, {counts_text(rates['planned_at_reset'])}"
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
        rows.append([f"{axis.name} ({magnitudes_text(axis)})", *cells])
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
