"""Ladders and certificates of rungs as parts of a page."""

from collections.abc import Iterator, Mapping

from lerobot_bimanual.ladder.falls import Fall, falls, level_sums
from lerobot_bimanual.ladder.result import LEAST_EXPERT_RATE, LadderResult
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.perturbation_levels import MAX_LEVEL

UPPER_LEVELS = range(1, MAX_LEVEL + 1)
SURE = 0.05
LEGEND = (
    "In bold: differs from level 0 on the same episodes, McNemar's exact test with p up to 0.05 as corrected by Holm for how "
    "many axes have a certified rung of that level. In brackets: not certified, since the expert solves less than "
    f"{LEAST_EXPERT_RATE:.0%}; counted in no sum.\n"
)
"""Of the tables of ladders."""


def ladders_page(ladders: Mapping[str, LadderResult]) -> str:
    """A section per ladder: successes of the policy at each level of each axis, and what is lost against level 0.

    Args:
        ladders: by name.
    """
    return "\n".join("\n".join(_ladder(name, ladder)) for name, ladder in ladders.items())


def _ladder(name: str, ladder: LadderResult) -> Iterator[str]:
    rates, found = ladder.level_0.rates, falls(ladder)
    seeds = ladder.level_0.seeds
    yield f"### {ladder.policy} on {ladder.task}: {name}\n"
    yield (
        f"Weights {ladder.checkpoint_sha256[:12]}, {ladder.options['split']} seeds {seeds[0]} to {seeds[-1]}, batches of "
        f"{ladder.batch_size}. Level 0: {rates['policy'].successes} of {rates['policy'].trials}, expert "
        f"{rates['expert'].successes}, blind {rates['blind'].successes}.\n"
    )
    rows = []
    for axis in ladder.axes:
        rungs = {rung.level: rung for rung in ladder.of_axis(axis.name)}
        cells = [_cell(found.get(rungs[level].name)) if level in rungs else "" for level in UPPER_LEVELS]
        magnitudes = ", ".join(f"{magnitude:g}" for magnitude in axis.magnitudes)
        rows.append([f"{axis.name} ({magnitudes} {axis.unit})", *cells])
    sums = level_sums(ladder)
    together = [
        f"{sums[level].successes} of {sums[level].trials}" if level in sums else "" for level in UPPER_LEVELS
    ]
    rows.append(["certified rungs together", *together])
    yield markdown_table(["axis", *(f"level {level}" for level in UPPER_LEVELS)], rows) + "\n"
    if ladder.not_applicable:
        yield f"Not applicable: {', '.join(ladder.not_applicable)}.\n"


def _cell(fall: Fall | None) -> str:
    """Successes; in bold where they differ from level 0; in brackets where the rung is not certified."""
    if fall is None:
        return ""
    solved = str(fall.rung.rates["policy"].successes)
    if fall.p_holm is None:
        return f"({solved})"
    return f"**{solved}**" if fall.p_holm <= SURE else solved


def certificates_page(certificates: Mapping[str, RungCertificate]) -> str:
    """On how many tasks each rung is certified; then, per task, what expert and blind control solve on every rung.

    Args:
        certificates: by task.
    """
    parts = (*_overview(certificates), *("\n".join(_certificate(each)) for each in certificates.values()))
    return "\n".join(parts)


def _overview(certificates: Mapping[str, RungCertificate]) -> Iterator[str]:
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
        magnitudes = ", ".join(f"{magnitude:g}" for magnitude in axis.magnitudes)
        rows.append([f"{axis.name} ({magnitudes} {axis.unit})", *cells])
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
