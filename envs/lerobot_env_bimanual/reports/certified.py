"""Certificates as Markdown tables: experts and controls and the tasks beside the paper's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.experts.control_names import CONTROLS
from lerobot_env_bimanual.experts.instruction_scripts import chance
from lerobot_env_bimanual.experts.runner import OUT_OF_MOVES, OUT_OF_TIME
from lerobot_env_bimanual.experts.seed_range import parse_seeds
from lerobot_env_bimanual.experts.stored_certificate import BadCertificate, StoredCertificate, StoredEpisode
from lerobot_env_bimanual.experts.strain import BOUNDS, Strain, peak_strain
from lerobot_env_bimanual.reports.paper import ORIGINAL_ORACLE, ORIGINAL_ORACLE_MEAN, PAPER
from lerobot_env_bimanual.tasks.registry import get_task

EXACT, ROUNDED = "expert", "expert_discretised"
CERTIFICATES = (EXACT, ROUNDED, *(name for name in CONTROLS if name != EXACT))
"""Names of the files, without `.json`."""

PLAYERS = (EXACT, ROUNDED, "blind", "random", "noop")
LANGUAGE_BLIND = "language_blind"

NOT_MEASURED = "–"

type Row = Mapping[str, Any]


@dataclass(frozen=True)
class Certified:
    """The certificates of one folder, by name."""

    certificates: Mapping[str, StoredCertificate]

    @classmethod
    def read(cls, folder: Path) -> Certified:
        """Read what is there.

        Raises:
            BimanualError: the folder has no certificate of the experts, a file that is none, or one that contradicts
                itself, its name, or that of the experts.
        """
        paths = {name: folder / f"{name}.json" for name in CERTIFICATES}
        if not paths[EXACT].is_file():
            raise BimanualError(
                f"{folder} holds no {EXACT}.json; make it with `lerobot-bimanual expert evaluate --variation=each "
                f"--replay=joint --output={folder / EXACT}.json`. Read are: {', '.join(path.name for path in paths.values())}"
            )
        if stray := sorted(set(folder.glob("*.json")) - set(paths.values())):
            names = ", ".join(path.name for path in paths.values())
            raise BimanualError(f"{stray[0]} has the name of no certificate; those are: {names}")
        certified = cls(
            {name: StoredCertificate.read(path) for name, path in paths.items() if path.is_file()}
        )
        for name in certified.certificates:
            certified._check_role(name)
        return certified

    def _check_role(self, name: str) -> None:
        """Whether a certificate is what its name says, and belongs to that of the experts."""
        certificate, experts = self.certificates[name], self.certificates[EXACT]
        campaign, beside = certificate.campaign, experts.campaign
        is_expert, control = name in (EXACT, ROUNDED), EXACT if name == ROUNDED else name
        seeds, theirs = parse_seeds(campaign.seeds), parse_seeds(beside.seeds)
        in_seeds = seeds == theirs if is_expert else seeds.start == theirs.start and seeds.stop <= theirs.stop
        worlds = {task: experts.worlds.get(task) for task in certificate.worlds}
        for field, got, holds, rule in (
            ("control", campaign.control, campaign.control == control, control),
            (
                "discretise",
                campaign.discretise,
                bool(campaign.discretise) == (name == ROUNDED),
                "at least 1" if name == ROUNDED else "0",
            ),
            ("perturb", campaign.perturb, not campaign.perturb, "empty"),
            ("replay", campaign.replay, name != EXACT or campaign.replay == "joint", "joint"),
            ("split", campaign.split, campaign.split == beside.split, beside.split),
            ("seeds", campaign.seeds, in_seeds, f"{beside.seeds}, or for controls the first of them"),
            ("versions", certificate.versions, certificate.versions == experts.versions, experts.versions),
            ("worlds", certificate.worlds, certificate.worlds == worlds, worlds),
            (
                "variations",
                "some only",
                not is_expert or certificate.covers_every_variation(),
                "every one of each task on all seeds, by --variation=each",
            ),
        ):
            if not holds:
                raise BadCertificate(
                    f"{certificate.path}: {field} is {shown(got, 400)}, but must be {rule} in a certificate of that name, "
                    f"beside {experts.path.name}"
                )

    @property
    def tasks(self) -> list[str]:
        """Names of the tasks whose experts are certified, in the paper's order."""
        return sorted(self.certificates[EXACT].worlds, key=lambda name: get_task(name).spec.id)

    def rows(self, name: str, task: str) -> list[Row]:
        """The rates of a task's variations in one certificate; none if there is no such certificate."""
        certificate = self.certificates.get(name)
        return [] if certificate is None else [row for row in certificate.rates if row["task"] == task]

    def episodes(self, name: str, task: str) -> list[StoredEpisode]:
        """The episodes of a task in one certificate."""
        return [episode for episode in self.certificates[name].episodes if episode.task == task]

    def rate(self, name: str, task: str) -> SuccessRate | None:
        """Success over all variations of a task; None if it was not measured."""
        rows = self.rows(name, task)
        if not rows:
            return None
        return SuccessRate(sum(row["successes"] for row in rows), sum(row["trials"] for row in rows))


def success_table(certified: Certified) -> pd.DataFrame:
    """Experts and controls, successes of trials per task."""
    headings = (
        "task",
        "expert",
        "rounded",
        "blind",
        "random",
        "no-op",
        "unread (chance)",
    )
    rows = []
    for task in certified.tasks:
        cells = [_cell(certified.rate(name, task)) for name in PLAYERS]
        rows.append((f"`{task}`", *cells, _unread(certified, task)))
    return pd.DataFrame(rows, columns=[*headings])


def _unread(certified: Certified, task: str) -> str:
    rate = certified.rate(LANGUAGE_BLIND, task)
    return _cell(rate) if rate is None else f"{_cell(rate)} ({chance(get_task(task)):.0%})"


def _cell(rate: SuccessRate | None) -> str:
    return NOT_MEASURED if rate is None else f"{rate.successes}/{rate.trials}"


def evidence_table(certified: Certified) -> pd.DataFrame:
    """What else was found out about the exact expert's episodes."""
    headings = (
        "task",
        "lowest of a variation's 95 % interval",
        "replayed bit for bit",
        "keyframes found again",
        "largest tip error",
        "planner failures",
        "lines replaced",
        "placements accepted",
    )
    rows = []
    for task in certified.tasks:
        variations = certified.rows(EXACT, task)
        solved = sum(row["successes"] for row in variations)
        failures = [episode.failure for episode in certified.episodes(EXACT, task)]
        rows.append(
            (
                f"`{task}`",
                f"{min(row['wilson_95'][0] for row in variations):.1%}",
                f"{sum(row['replayed'] for row in variations)}/{solved}",
                f"{sum(row['keyframes_found'] for row in variations)}/{solved}",
                f"{max(row['worst_tip_error_mm'] for row in variations):.1f} mm",
                sum(failure not in ("", OUT_OF_MOVES, OUT_OF_TIME) for failure in failures),
                sum(row["line_fallbacks"] for row in variations),
                f"{_acceptance(variations):.0%}",
            )
        )
    return pd.DataFrame(rows, columns=[*headings])


def paper_table(certified: Certified) -> pd.DataFrame:
    """Variations, items, keyframes, duration and oracle, here and in the paper."""
    headings = ("task", "variations", "items", "keyframes", "duration", "oracle of the original")
    rows = []
    for task in certified.tasks:
        spec, paper, variations = get_task(task).spec, PAPER.get(task), certified.rows(EXACT, task)
        oracle = ORIGINAL_ORACLE.get(task)
        rows.append(
            (
                f"`{task}`",
                len(spec.variations),
                f"{movable_items(task)} ({paper.items if paper else NOT_MEASURED})",
                f"{_mean(variations, lambda row: row['median_keyposes']):.1f} "
                f"({paper.keyframes if paper else NOT_MEASURED})",
                f"{_mean(variations, lambda row: row['median_s']):.1f} s "
                f"({f'{paper.duration_s:.1f} s' if paper else NOT_MEASURED})",
                NOT_MEASURED if oracle is None else f"{oracle:.0%}",
            )
        )
    rows.append(("all", sum(row[1] for row in rows), "", "", "", f"{ORIGINAL_ORACLE_MEAN:.1%}"))
    return pd.DataFrame(rows, columns=[*headings])


def strain_table(certified: Certified) -> pd.DataFrame:
    """The peaks of the experts' episodes beside their bounds."""
    headings = (
        "task",
        "torque",
        "a motor at its limit",
        "velocity",
        "acceleration",
        "jerk",
        "contact force",
        "finger speed",
        "penetration",
        "contact force, rounded",
    )
    rows = [("*at most*", *_strain_cells(Strain(**BOUNDS, penetrating="")), "")]
    for task in certified.tasks:
        exact, rounded = (_peak_strain(certified.rows(name, task)) for name in (EXACT, ROUNDED))
        assert exact is not None  # every certified task has rows of the exact expert
        cell = NOT_MEASURED if rounded is None else f"{rounded.contact_force_n:.0f} N"
        rows.append((f"`{task}`", *_strain_cells(exact), cell))
        if own := get_task(task).spec.strain_bounds:
            rows.append(
                (f"*at most in `{task}`*", *_strain_cells(Strain(**BOUNDS | dict(own), penetrating="")), "")
            )
    return pd.DataFrame(rows, columns=[*headings])


def excess_sentence(certified: Certified) -> str:
    """Which of the exact experts' episodes ask for more than the bounds."""
    complaints = certified.certificates[EXACT].complaints
    played = len(certified.certificates[EXACT].episodes)
    if not complaints:
        return f"None of the {played} episodes is beyond its bounds."
    return f"Of the {played} episodes {len(complaints)} are beyond a bound: {'; '.join(complaints)}."


def _peak_strain(rows: Sequence[Row]) -> Strain | None:
    strains = [Strain(**row["strain"]) for row in rows if "strain" in row]
    return peak_strain(strains) if strains else None


def _strain_cells(strain: Strain) -> tuple[str, ...]:
    return (
        f"{strain.torque:.0%}",
        f"{strain.saturated:.1%}",
        f"{strain.velocity:.0%}",
        f"{strain.acceleration:.0%}",
        f"{strain.jerk:.0%}",
        f"{strain.contact_force_n:.0f} N",
        f"{strain.finger_speed_m_s:.2f} m/s",
        f"{strain.penetration_mm:.1f} mm" + (f" ({strain.penetrating})" if strain.penetrating else ""),
    )


def movable_items(task: str) -> int:
    """Things of the scene that can move by themselves: free objects, and each door, drawer or button."""
    from lerobot_bimanual.arms import ARMS
    from lerobot_env_bimanual.world.scene import Scene

    return Scene(get_task(task).spec.props).model.ntree - len(ARMS)


def _acceptance(rows: Sequence[Row]) -> float:
    """Episodes over placements drawn for them."""
    return sum(row["trials"] for row in rows) / sum(row["trials"] / row["acceptance"] for row in rows)


def _mean(rows: Sequence[Row], value: Callable[[Row], float]) -> float:
    """Over variations, weighted by their episodes."""
    return sum(value(row) * row["trials"] for row in rows) / sum(row["trials"] for row in rows)
