"""The expert and the blind control on rungs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.experts.campaign import Campaign
from lerobot_env_bimanual.experts.control_names import ControlName
from lerobot_env_bimanual.experts.outcome import Job, Keyposes
from lerobot_env_bimanual.experts.replanning import expert_under
from lerobot_env_bimanual.ladder.rungs import perturb_text
from lerobot_env_bimanual.tasks.registry import get_task

type RungKey = tuple[str, int]
"""Axis and level."""
type ControlOfRungs = Literal["expert", "blind"]


def _player(control: ControlOfRungs, axis: str) -> ControlName:
    """Who plays as a control on the rungs of an axis; level 0 is of no axis."""
    return expert_under([axis] if axis else []) if control == "expert" else control


@dataclass(frozen=True)
class Controls:
    """Who plays beside a policy, on episodes of one task; an outcome that the campaign's log knows is not played again.

    Attributes:
        campaign: the processes that play.
        task: name of the task.
        variation: index, or "any".
        split: of the seeds.
    """

    campaign: Campaign
    task: str
    variation: str
    split: str

    def solved(
        self, control: ControlOfRungs, rungs: Iterable[RungKey], seeds: Sequence[int]
    ) -> dict[RungKey, tuple[int, ...]]:
        """The seeds that a control solves on each rung, rising.

        Where things are moved after the start, the expert is the one that looks again then (`rereading`). The blind control knows the variation, as a policy does from the
        instruction, and plays the mean keyposes of training episodes of level 0.

        Raises:
            BimanualError: an episode could not be played.
        """
        keyposes = self._blind_keyposes(seeds) if control == "blind" else {}
        variations = self._variations(seeds)
        jobs = {
            (rung, seed): Job(
                self.task,
                self.variation,
                self.split,
                seed,
                _player(control, rung[0]),
                blind_keyposes=keyposes.get(variations[seed], ()),
                perturb=perturb_text(*rung),
            )
            for rung in rungs
            for seed in seeds
        }
        outcomes = self.campaign.play([*jobs.values()], f"{self.task}: {control}")
        solved: dict[RungKey, tuple[int, ...]] = {rung: () for rung, _ in jobs}
        for (rung, seed), outcome in zip(jobs, outcomes, strict=True):
            if outcome.success:
                solved[rung] += (seed,)
        return solved

    def _variations(self, seeds: Collection[int]) -> dict[int, int]:
        spec = get_task(self.task).spec
        fixed = spec.variation_index(self.variation)
        return {seed: draw_episode(spec, self.split, seed, fixed).variation.index for seed in seeds}

    def _blind_keyposes(self, seeds: Collection[int]) -> dict[int, Keyposes]:
        """By variation."""
        drawn = sorted(set(self._variations(seeds).values()))
        return {index: self.campaign.blind_keyposes(self.task, str(index)) for index in drawn}
