"""Certificates of rungs: the expert and the blind control on every rung of a task that changes what happens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.ladder.rung_certificate import (
    CERTIFICATE_SCHEMA_VERSION,
    CertifiedRung,
    RungCertificate,
)
from lerobot_env_bimanual.experts.campaign import Campaign
from lerobot_env_bimanual.experts.outcome_log import OutcomeLog, versions
from lerobot_env_bimanual.ladder.controls import Controls, RungKey
from lerobot_env_bimanual.ladder.rungs import Rungs
from lerobot_env_bimanual.ladder.worlds import worlds_of
from lerobot_env_bimanual.options import ANY_VARIATION

SPLIT = "test"


@dataclass(frozen=True)
class RungCertification:
    """What is to be certified of a task, and where it is kept.

    Attributes:
        task: its name.
        rungs: of the task; axes that are only seen are left out, since there expert and blind control play as at level 0.
        expert_seeds: of the split `test`.
        blind_seeds: likewise, for the blind control.
        output: the certificate, a JSON file.
    """

    task: str
    rungs: Rungs
    expert_seeds: range
    blind_seeds: range
    output: Path

    def certify(self, workers: int) -> RungCertificate:
        """Play what no certificate in the file's place says of this world, and write them together.

        Raises:
            BimanualError: the file is damaged or of other seeds or versions, or an episode could not be played.
        """
        before = self._before()
        keys = [key for key in self.rungs if self.rungs.played_as(*key) == key]
        log = OutcomeLog(self.output.with_suffix(".partial.jsonl"))
        with Campaign(workers, log) as campaign:
            worlds = worlds_of(self.task, keys, campaign)
            rungs = {
                (rung.axis, rung.level): rung
                for rung in (before.rungs if before else ())
                if worlds.get((rung.axis, rung.level), rung.world) == rung.world
            }
            rungs |= self._play(campaign, [key for key in keys if key not in rungs], worlds)
        axes = self.rungs.records() | ({axis.name: axis for axis in before.axes} if before else {})
        left_out = {*self.rungs.not_applicable, *(before.not_applicable if before else ())}
        certificate = RungCertificate(
            **self._head(),
            axes=tuple(axes[name] for name in sorted({axis for axis, _ in rungs if axis})),
            not_applicable=tuple(sorted(left_out)),
            rungs=tuple(rungs[key] for key in sorted(rungs)),
        )
        certificate.write(self.output)
        log.remove()
        return certificate

    def _play(
        self, campaign: Campaign, keys: list[RungKey], worlds: dict[RungKey, str]
    ) -> dict[RungKey, CertifiedRung]:
        if not keys:
            return {}
        controls = Controls(campaign, self.task, ANY_VARIATION, SPLIT)
        expert = controls.solved("expert", keys, self.expert_seeds)
        blind = controls.solved("blind", keys, self.blind_seeds)
        return {
            key: CertifiedRung(
                axis=key[0],
                level=key[1],
                world=worlds[key],
                expert_failed=self._failed(expert[key]),
                blind_solved=blind[key],
            )
            for key in keys
        }

    def _failed(self, solved: tuple[int, ...]) -> tuple[int, ...]:
        """The expert's seeds that are not among the solved ones."""
        return tuple(seed for seed in self.expert_seeds if seed not in solved)

    def _before(self) -> RungCertificate | None:
        """The certificate in the file's place, if there is one."""
        if not self.output.exists():
            return None
        before, axes = RungCertificate.read(self.output), self.rungs.records()
        pairs = {name: (getattr(before, name), value) for name, value in self._head().items()}
        pairs |= {f"axis {axis.name}": (axis, axes[axis.name]) for axis in before.axes if axis.name in axes}
        for name, (theirs, ours) in pairs.items():
            if theirs != ours:
                raise BimanualError(
                    f"{self.output} has {name} {shown(theirs)}, but here it is {shown(ours)}; choose another --output, or "
                    "remove the file to certify anew"
                )
        return before

    def _head(self) -> dict[str, Any]:
        return {
            "schema_version": CERTIFICATE_SCHEMA_VERSION,
            "task": self.task,
            "split": SPLIT,
            "expert_seeds": (self.expert_seeds.start, self.expert_seeds.stop),
            "blind_seeds": (self.blind_seeds.start, self.blind_seeds.stop),
            "versions": versions(),
        }
