"""The result of a campaign, for people and for programs."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.tables import print_table
from lerobot_env_bimanual.experts.control_names import EXPERTS
from lerobot_env_bimanual.experts.criteria import complaints, rates
from lerobot_env_bimanual.experts.outcome import Outcome
from lerobot_env_bimanual.experts.outcome_log import versions
from lerobot_env_bimanual.experts.strain import peak_strain
from lerobot_env_bimanual.experts.world_version import world_version

STATE_HASH_DIGITS = 16
"""Of each state hash, as many as tell all episodes apart."""


@dataclass(frozen=True)
class Certificate:
    """Outcomes of one control.

    Attributes:
        control: who played.
        discretise: voxels per axis to which the expert's keyposes were rounded, or 0.
        replay: how its episodes were replayed.
        split: split of the seeds.
        seeds: the range a:b.
        outcomes: of all episodes.
        perturb: what was different from the world as it is, `AXIS:LEVEL,...`.
    """

    control: str
    discretise: int
    replay: str
    split: str
    seeds: str
    outcomes: tuple[Outcome, ...]
    perturb: str = ""

    @cached_property
    def complaints(self) -> list[str]:
        """Why this is not good enough; empty if it is."""
        return complaints(self.control, self.discretise, self.outcomes)

    def of(self, task: str, variation: int) -> list[Outcome]:
        """The outcomes of one variation."""
        return [
            outcome for outcome in self.outcomes if (outcome.task, outcome.variation) == (task, variation)
        ]

    def write(self, path: Path) -> None:
        """Write a JSON file with one episode per line.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        head = {
            "control": self.control,
            "discretise": self.discretise,
            "replay": self.replay,
            "split": self.split,
            "seeds": self.seeds,
            "perturb": self.perturb,
            "versions": versions(),
            "worlds": {
                task: world_version(task, self.perturb)
                for task in sorted({outcome.task for outcome in self.outcomes})
            },
            "complaints": self.complaints,
            "rates": [row | self._measured(row["task"], row["variation"]) for row in self.rate_rows()],
        }
        episodes = ",\n  ".join(json.dumps(_compact(outcome)) for outcome in self.outcomes)
        text = json.dumps(head, indent=1).removesuffix("\n}")
        write_file(path, f'{text},\n "episodes": [\n  {episodes}\n ]\n}}\n')

    def rate_rows(self) -> list[dict[str, Any]]:
        """What is said of each variation, but for the strain of the arms."""
        return [self._rate_row(*key) for key in rates(self.outcomes)]

    def _rate_row(self, task: str, variation: int) -> dict[str, Any]:
        outcomes = self.of(task, variation)
        rate = rates(outcomes)[task, variation]
        row = {"task": task, "variation": variation, **asdict(rate), "wilson_95": list(rate.interval)}
        solved = [outcome for outcome in outcomes if outcome.success]
        if self.control in EXPERTS and solved:
            evidence = [outcome.evidence for outcome in solved if outcome.evidence is not None]
            row |= {
                "median_s": median(outcome.ticks for outcome in solved) / CONTROL_HZ,
                "longest_s": max(outcome.ticks for outcome in solved) / CONTROL_HZ,
                "median_keyposes": float(median(len(outcome.keyposes) for outcome in solved)),
                "acceptance": len(outcomes) / sum(outcome.draws for outcome in outcomes),
                "line_fallbacks": sum(outcome.line_fallbacks for outcome in outcomes),
                "worst_tip_error_mm": worst_tip_error_mm(solved),
                "keyframes_found": sum(found.keyframes_found for found in evidence),
                "replayed": sum(bool(found.replayed) for found in evidence),
            }
        return row

    def _measured(self, task: str, variation: int) -> dict[str, Any]:
        """The peak strain in the expert's episodes, as a part of a row."""
        evidence = [outcome.evidence for outcome in self.of(task, variation) if outcome.evidence is not None]
        if not evidence:
            return {}
        return {"strain": asdict(peak_strain([found.strain for found in evidence]))}

    def print(self) -> None:
        """Print a table, the failures of an expert, and the complaints."""
        rounding = f", keyposes rounded to {self.discretise} voxels per axis" if self.discretise else ""
        headings = ("task", "variation", "successes", "95 % interval", "median time", "worst tip error")
        rows, console = [], Console()
        perturbed = f", {self.perturb}" if self.perturb else ""
        for (task, variation), rate in rates(self.outcomes).items():
            outcomes = self.of(task, variation)
            low, high = rate.interval
            rows.append(
                (
                    task,
                    variation,
                    f"{rate.successes}/{rate.trials}",
                    f"{low:.1%} to {high:.1%}",
                    f"{median(outcome.ticks for outcome in outcomes) / CONTROL_HZ:.1f} s",
                    f"{worst_tip_error_mm(outcomes):.1f} mm" if self.control in EXPERTS else "",
                )
            )
        print_table(headings, rows, f"{self.control} on {self.split} seeds {self.seeds}{rounding}{perturbed}")
        for outcome in self.outcomes:
            if self.control in EXPERTS and not outcome.success:
                console.print(_failure(outcome), highlight=False, soft_wrap=True)
        for complaint in self.complaints:
            console.print(f"not good enough: {complaint}", style="red", highlight=False, soft_wrap=True)


def worst_tip_error_mm(outcomes: list[Outcome]) -> float:
    """Largest distance of a hand from its target at the end of a keypose, but the one at which the episode ended."""
    errors = [max(report.tip_error_mm) for outcome in outcomes for report in outcome.keyposes[:-1]]
    return max(errors, default=0.0)


def _failure(outcome: Outcome) -> str:
    unmet = ", ".join(outcome.unmet) or "none"
    return (
        f"{outcome.task} seed {outcome.seed} (variation {outcome.variation}): {outcome.failure}, at "
        f"{outcome.last_move!r}; unmet: {unmet}"
    )


def _compact(outcome: Outcome) -> dict[str, Any]:
    """An episode in a few hundred bytes: commanded poses are left out, for a replay from the seed gives them."""
    fields = asdict(outcome)
    del fields["split"]  # the same for all
    fields["state_hash"] = fields["state_hash"][:STATE_HASH_DIGITS]
    reports, evidence = fields.pop("keyposes"), fields.pop("evidence")
    fields["keyposes"] = [[report["name"], report["ticks"], *report["tip_error_mm"]] for report in reports]
    if evidence is not None:
        fields["keyframes_found"], fields["replayed"] = evidence["keyframes_found"], evidence["replayed"]
    return fields
