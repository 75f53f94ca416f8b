"""Certificates of rungs as parts of a page."""

from collections.abc import Iterator, Mapping

from lerobot_bimanual.ladder.ladders_page import UPPER_LEVELS, magnitudes_text
from lerobot_bimanual.ladder.result import LEAST_EXPERT_RATE
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.markdown_table import markdown_table

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
