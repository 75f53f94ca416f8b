"""A policy on the ladder of a task: what is not played yet is played, and every rung is kept as soon as it is."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.ladder.result import (
    LADDER_SCHEMA_VERSION,
    LEVEL_0,
    LadderResult,
    Rung,
    RungEpisode,
    rung_name,
)
from lerobot_bimanual.ladder.rung_certificate import RungCertificate
from lerobot_bimanual.results.evaluation import EvaluationRecord, result_versions
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.checkpoint import Checkpoint
from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.episode_log import RECORDED_OPTIONS
from lerobot_env_bimanual.experts.campaign import Campaign
from lerobot_env_bimanual.experts.outcome_log import OutcomeLog
from lerobot_env_bimanual.ladder.controls import ControlOfRungs, Controls, RungKey
from lerobot_env_bimanual.ladder.rung_rollout import RungRollout
from lerobot_env_bimanual.ladder.rungs import Rungs, perturb_text
from lerobot_env_bimanual.ladder.worlds import worlds_of

FEW = 4
"""Episodes of the expert from which the time is estimated."""
CONTROLS: tuple[ControlOfRungs, ...] = ("expert", "blind")


@dataclass(frozen=True)
class Climb:
    """What is to be played, and where it is kept.

    Attributes:
        checkpoint: of the policy.
        config: environment at level 0, of one task.
        rungs: of that task.
        seeds: consecutive, the same on all rungs.
        batch_size: environments side by side.
        policy_flags: what is set in the policy's config over what the checkpoint says, such as `--device=cpu`.
        workers: processes for expert and blind control; 0 takes one per core.
        output: the result, a JSON file.
        certificate: of the task's rungs, if there is one.
    """

    checkpoint: Checkpoint
    config: BimanualEnvConfig
    rungs: Rungs
    seeds: range
    batch_size: int
    policy_flags: tuple[str, ...]
    workers: int
    output: Path
    certificate: RungCertificate | None

    @property
    def task(self) -> str:
        """Its name."""
        return self.config.tasks[0]

    @property
    def records(self) -> Path:
        """Folder of the environment's records, one file per rung, with every action of the policy."""
        return self.output.with_name(f"{self.output.stem}_records")

    @property
    def controls_log(self) -> Path:
        """What expert and blind control have played, for all policies of the task whose results lie in the same folder."""
        return self.output.with_name(f"{self.task}_controls.jsonl")

    def played(self) -> LadderResult | None:
        """What an earlier run has left; None if there was none.

        Raises:
            BimanualError: the file is damaged, or of another policy, or other episodes.
        """
        if not self.output.exists():
            return None
        result = LadderResult.read(self.output)
        level_0, axes = result.level_0, self.rungs.records()
        pairs: dict[str, tuple[Any, Any]] = {
            name: (getattr(result, name), value) for name, value in self._head().items() if name != "date"
        }
        del pairs["checkpoint"]  # the same weights may have moved
        pairs["seeds"] = (level_0.seeds, list(self.seeds))
        pairs |= {f"axis {axis.name}": (axis, axes[axis.name]) for axis in result.axes if axis.name in axes}
        self._check(pairs)
        return result

    def missing(self) -> list[RungKey]:
        """Rungs that are not played yet.

        Raises:
            BimanualError: as in `played`.
        """
        result = self.played()
        there = {(rung.axis, rung.level) for rung in result.rungs} if result else set()
        return [key for key in self.rungs if key not in there]

    def _check(self, pairs: Mapping[str, tuple[Any, Any]]) -> None:
        """Make sure that what an earlier run has left is what would be played here.

        Args:
            pairs: what it is called -> what it was, and what it is here.
        """
        for name, (theirs, ours) in pairs.items():
            if theirs != ours:
                raise BimanualError(
                    f"{self.output} has {name} {shown(theirs)}, but here it is {shown(ours)}; choose another --output, or "
                    "remove the file to play anew"
                )

    def _check_worlds(self) -> None:
        """Make sure that the rungs of this ladder that are played or certified are of the worlds here."""
        result, asked_for = self.played(), [*self.rungs]
        played = {(rung.axis, rung.level): rung.world for rung in (result.rungs if result else ())}
        certified = {
            (rung.axis, rung.level): rung for rung in (self.certificate.rungs if self.certificate else ())
        }
        decisive = {self.rungs.played_as(*key) for key in asked_for} & certified.keys()
        if not (keys := sorted(decisive | ({*asked_for} & played.keys()))):
            return
        with Campaign(self.workers) as campaign:
            here = worlds_of(self.task, keys, campaign)
        worlds = {key: (played[key], here[key]) for key in keys if key in played}
        self._check({f"world of {rung_name(*key)}": pair for key, pair in worlds.items()})
        for key in sorted(decisive):
            if (theirs := certified[key].world) != here[key]:
                raise BimanualError(
                    f"the certificate of {self.task} at {rung_name(*key)} is of world {theirs}, but here it is {here[key]}; "
                    "certify anew with `lerobot-bimanual expert evaluate-perturbed`"
                )

    def climb(self) -> Iterator[Rung]:
        """Take the certificate into what is played, play what is missing, and give each rung when it is in the file.

        Raises:
            BimanualError: as in `played`, or a rung or its certificate is of another world, or something cannot be played.
        """
        self._check_worlds()
        result, missing = self.played(), self.missing()
        if result is not None and (certified := self._with_certificate(result)) != result:
            result = certified
            result.write(self.output)
        if not missing:
            return
        rollout = self._rollout()  # which may fail, before anything is played
        solved = self._play_controls(missing)
        with tqdm(total=len(missing) * len(self.seeds), unit="episode", smoothing=0) as bar:
            for key in missing:
                perturb = perturb_text(*key)
                bar.set_description(f"{self.task}: {perturb or LEVEL_0}")
                rung = self._rung(key, rollout.play(perturb, self.records, bar.update), solved)
                result = self._with(result, rung)
                result.write(self.output)
                yield rung

    def estimate_s(self, folder: Path) -> float:
        """About how long the missing rungs take, from a few episodes played now at level 0.

        Args:
            folder: where their records may lie.

        Raises:
            BimanualError: as in `climb`.
        """
        self._check_worlds()
        missing, few = self.missing(), self.seeds[:FEW]
        as_played = {self.rungs.played_as(*key) for key in missing}
        rollout = self._rollout(self.seeds[: self.batch_size])
        started = time.monotonic()
        with Campaign(self.workers) as campaign:
            self._controls(campaign).solved("expert", [("", 0)], few)
        expert_s = (time.monotonic() - started) / len(few)
        rollout.play("", folder)  # whose first batch warms up
        started = time.monotonic()
        rollout.play("", folder)
        batches = -(-len(self.seeds) // self.batch_size) * len(missing)
        episodes_of_controls = len(CONTROLS) * len(as_played) * len(self.seeds)
        return expert_s * episodes_of_controls + (time.monotonic() - started) * batches

    def _rollout(self, seeds: range | None = None) -> RungRollout:
        return RungRollout(
            self.checkpoint, self.config, self.batch_size, seeds or self.seeds, self.policy_flags
        )

    def _controls(self, campaign: Campaign) -> Controls:
        return Controls(campaign, self.task, str(self.config.variation), self.config.split)

    def _play_controls(
        self, missing: Iterable[RungKey]
    ) -> dict[ControlOfRungs, dict[RungKey, tuple[int, ...]]]:
        """Seeds that expert and blind control solve, by who plays and rung."""
        keys = dict.fromkeys(self.rungs.played_as(*key) for key in missing)
        with Campaign(self.workers, OutcomeLog(self.controls_log)) as campaign:
            controls = self._controls(campaign)
            return {control: controls.solved(control, keys, self.seeds) for control in CONTROLS}

    def _rung(
        self,
        key: RungKey,
        record: EvaluationRecord,
        solved: dict[ControlOfRungs, dict[RungKey, tuple[int, ...]]],
    ) -> Rung:
        axis, level = key
        played_as = self.rungs.played_as(axis, level)
        return Rung(
            axis=axis,
            level=level,
            world=record.world,
            expert=solved["expert"][played_as],
            blind=solved["blind"][played_as],
            certificate=self._certified(key),
            episodes=tuple(
                RungEpisode(
                    seed=episode.seed,
                    variation=episode.variation or 0,
                    success=episode.success,
                    failure=episode.failure or "",
                    keyposes=episode.keyposes or 0,
                    ticks=episode.ticks or 0,
                )
                for episode in record.episodes
            ),
        )

    def _certified(self, key: RungKey) -> SuccessRate | None:
        """The expert on the many seeds of the certificate, if that has the rung."""
        certificate = self.certificate
        found = certificate and certificate.find(*self.rungs.played_as(*key))
        return certificate.rates(found)["expert"] if certificate and found else None

    def _with_certificate(self, result: LadderResult) -> LadderResult:
        """A result whose rungs of this ladder are certified by what the certificate says now."""
        ours = {*self.rungs}
        certified = {
            (rung.axis, rung.level): self._certified((rung.axis, rung.level))
            for rung in result.rungs
            if (rung.axis, rung.level) in ours
        }
        rungs = (
            replace(rung, certificate=certified.get((rung.axis, rung.level)) or rung.certificate)
            for rung in result.rungs
        )
        return replace(result, rungs=tuple(rungs))

    def _with(self, result: LadderResult | None, rung: Rung) -> LadderResult:
        """The result with one rung more."""
        if result is None:
            return LadderResult(
                **self._head(), axes=(), not_applicable=self.rungs.not_applicable, rungs=(rung,)
            )
        rungs = sorted((*result.rungs, rung), key=lambda rung: (rung.axis, rung.level))
        axes = {axis.name: axis for axis in result.axes} | {rung.axis: self.rungs.records()[rung.axis]}
        left_out = {*result.not_applicable, *self.rungs.not_applicable}
        return replace(
            result,
            axes=tuple(axes[name] for name in sorted(axes)),
            not_applicable=tuple(sorted(left_out)),
            rungs=tuple(rungs),
        )

    def _head(self) -> dict[str, Any]:
        """What is said of all rungs."""
        return {
            "schema_version": LADDER_SCHEMA_VERSION,
            "task": self.task,
            "policy": self.checkpoint.policy,
            "checkpoint": str(self.checkpoint.folder),
            "checkpoint_sha256": self.checkpoint.sha256,
            "options": {
                name: str(getattr(self.config, name)) for name in RECORDED_OPTIONS if name != "perturb"
            },
            "batch_size": self.batch_size,
            "versions": result_versions(),
            "date": date.today().isoformat(),
        }
