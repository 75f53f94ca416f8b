"""Certificates as they lie in files, read only if they are true of themselves.

What follows from the episodes is computed again: rates, medians, intervals and complaints. What does not (who played,
from which seeds, in which world) is held against what there is, and by `reports` against other certificates.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import read_json, shown
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.versions import SIMULATION_PACKAGES
from lerobot_env_bimanual.experts.certificate import STATE_HASH_DIGITS, Certificate
from lerobot_env_bimanual.experts.control_names import EXPERTS, ControlName
from lerobot_env_bimanual.experts.evidence import Evidence
from lerobot_env_bimanual.experts.outcome import MoveReport, Outcome
from lerobot_env_bimanual.experts.seed_range import parse_seeds
from lerobot_env_bimanual.experts.strain import BOUNDS, Strain, excesses
from lerobot_env_bimanual.experts.world_version import VERSION_DIGITS, is_version
from lerobot_env_bimanual.perturbations.registry import chosen_levels
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

NAN = float("nan")
UNKNOWN_STRAIN = Strain(NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, "")
"""Certificates hold those of each variation, not of each episode."""

MEASURED = ("strain",)
"""Fields of the rows of experts that do not follow from the episodes as they are stored."""
EVIDENCE = ("keyframes_found", "replayed")
"""Fields that the solved episodes of experts have besides."""


class BadCertificate(BimanualError):
    """A certificate that contradicts itself, or another; the message names file and field."""


@dataclass(frozen=True)
class StoredEpisode:
    """One episode of a certificate; fields as in `Outcome`, keyposes as (name, ticks, left and right tip error in mm)."""

    task: str
    variation: int
    seed: int
    success: bool
    failure: str
    last_move: str
    unmet: tuple[str, ...]
    ticks: int
    draws: int
    line_fallbacks: int
    unstable: bool
    state_hash: str
    keyposes: tuple[tuple[str, int, float, float], ...]
    keyframes_found: bool | None
    replayed: bool | None

    def outcome(self, split: str) -> Outcome:
        """The outcome, without what certificates leave out: poses, arrival and strain."""
        found, replayed = self.keyframes_found, self.replayed
        return Outcome(
            task=self.task,
            variation=self.variation,
            split=split,
            seed=self.seed,
            success=self.success,
            failure=self.failure,
            last_move=self.last_move,
            unmet=self.unmet,
            keyposes=tuple(
                MoveReport(name, (), ticks, (left_mm, right_mm), arrived=True)
                for name, ticks, left_mm, right_mm in self.keyposes
            ),
            ticks=self.ticks,
            draws=self.draws,
            line_fallbacks=self.line_fallbacks,
            unstable=self.unstable,
            state_hash=self.state_hash,
            evidence=None if found is None else Evidence(found, replayed, UNKNOWN_STRAIN),
        )


@dataclass(frozen=True)
class _Content:
    """A certificate's file; see `StoredCertificate`."""

    control: ControlName
    discretise: int
    replay: Literal["none", "joint", "keypose"]
    split: Literal["train", "val", "test"]
    seeds: str
    perturb: str
    versions: dict[str, str]
    worlds: dict[str, str]
    complaints: tuple[str, ...]
    rates: tuple[dict[str, Any], ...]
    episodes: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class StoredCertificate:
    """A certificate that is true of itself.

    Attributes:
        path: its file.
        campaign: who played what, and the outcomes.
        versions: package -> version.
        worlds: task -> version of its world.
        complaints: why it is not good enough.
        rates: one row per task and variation.
        episodes: one per task, variation and seed.
    """

    path: Path
    campaign: Certificate
    versions: dict[str, str]
    worlds: dict[str, str]
    complaints: tuple[str, ...]
    rates: tuple[dict[str, Any], ...]
    episodes: tuple[StoredEpisode, ...]

    @classmethod
    def read(cls, path: Path) -> StoredCertificate:
        """The certificate in a file.

        Raises:
            BimanualError: the file is no JSON.
            BadCertificate: it lacks a field, or contradicts itself.
        """
        content = read_json(path)
        try:
            stored = _decoded(path, content)
            contradiction = next(_contradictions(stored), None)
        except BimanualError as error:
            raise BadCertificate(f"{path}: {error}") from error
        if contradiction is not None:
            raise BadCertificate(f"{path}: {contradiction}")
        return stored

    def covers_every_variation(self) -> bool:
        """Whether every variation of each of its tasks was played on all seeds."""
        played = Counter((episode.task, episode.variation) for episode in self.episodes)
        return all(
            played[task, variation.index] == len(parse_seeds(self.campaign.seeds))
            for task in self.worlds
            for variation in get_task(task).spec.variations
        )


def _decoded(path: Path, content: Any) -> StoredCertificate:
    head = decode(_Content, content, "certificate")
    episodes = tuple(
        decode(StoredEpisode, dict.fromkeys(EVIDENCE) | episode, f"episodes[{index}]")
        for index, episode in enumerate(head.episodes)
    )
    for index, episode in enumerate(head.episodes):
        wanted = set(EVIDENCE) if head.control in EXPERTS and episode["success"] else set()
        if set(EVIDENCE) & set(episode) != wanted:
            raise BadCertificate(
                f"episodes[{index}] must have {', '.join(EVIDENCE)} just if an expert solved it"
            )
    outcomes = tuple(episode.outcome(head.split) for episode in episodes)
    campaign = Certificate(
        head.control, head.discretise, head.replay, head.split, head.seeds, outcomes, head.perturb
    )
    return StoredCertificate(
        path, campaign, head.versions, head.worlds, head.complaints, head.rates, episodes
    )


def _contradictions(stored: StoredCertificate) -> Iterator[str]:
    """Each in one sentence; later ones build on there being no earlier ones."""
    yield from _faults_of_head(stored)
    for index, episode in enumerate(stored.episodes):
        for fault in _faults_of_episode(episode, stored.campaign.replay):
            yield f"episodes[{index}] ({episode.task} seed {episode.seed}): {fault}"
    yield from _faults_of_seeds(stored)
    yield from _faults_of_rates(stored)
    found = stored.campaign.complaints
    # Hands that did not arrive, and an episode's strain, are seen in what certificates leave out.
    if missing := [complaint for complaint in found if complaint not in stored.complaints]:
        yield f"complaints is {shown(stored.complaints)}, but the episodes also give {shown(missing)}"


def _faults_of_head(stored: StoredCertificate) -> Iterator[str]:
    campaign = stored.campaign
    if not 0 <= campaign.discretise < 2**16:
        yield f"discretise is {shown(campaign.discretise)}, but must be voxels per axis, or 0"
    chosen_levels(campaign.perturb)
    wanted = {*SIMULATION_PACKAGES, "python"}
    if set(stored.versions) != wanted:
        yield f"versions is of {shown(sorted(stored.versions))}, but must be of {', '.join(sorted(wanted))}"
    for task, world in stored.worlds.items():
        if task not in list_tasks():
            yield f"worlds holds {shown(task)}, but tasks are: {', '.join(list_tasks())}"
        if not is_version(world):
            yield f"worlds.{task} is {shown(world)}, but must be {VERSION_DIGITS} hex digits"
    played = sorted({episode.task for episode in stored.episodes})
    if not played or sorted(stored.worlds) != played:
        yield f"worlds is of {shown(sorted(stored.worlds))}, but the episodes are of {shown(played)}"


def _faults_of_episode(episode: StoredEpisode, replay: str) -> Iterator[str]:
    spec = get_task(episode.task).spec
    played, last = sum(ticks for _, ticks, *_ in episode.keyposes), episode.keyposes[-1:]
    for name, holds, rule in (
        ("variation", 0 <= episode.variation < len(spec.variations), f"0 to {len(spec.variations) - 1}"),
        ("failure", episode.success == (not episode.failure), "empty just if it is a success"),
        ("unmet", not (episode.success and episode.unmet), "empty in a success"),
        ("ticks", episode.ticks >= 0, "at least 0"),
        ("ticks", not last or played == episode.ticks, f"those of its keyposes, {shown(played)}"),
        ("last_move", not last or last[0][0] == episode.last_move, "the name of the last keypose"),
        ("draws", episode.draws >= 1, "at least 1"),
        ("line_fallbacks", episode.line_fallbacks >= 0, "at least 0"),
        (
            "state_hash",
            re.fullmatch(f"[0-9a-f]{{{STATE_HASH_DIGITS}}}", episode.state_hash),
            f"{STATE_HASH_DIGITS} hex digits",
        ),
        (
            "replayed",
            episode.keyframes_found is None or (episode.replayed is None) == (replay == "none"),
            f"known just if there were replays; the certificate says {replay!r}",
        ),
    ):
        if not holds:
            yield f"{name} is {shown(getattr(episode, name))}, but must be {rule}"


def _faults_of_seeds(stored: StoredCertificate) -> Iterator[str]:
    """Every seed of the range once, or once per variation, and no other."""
    seeds = parse_seeds(stored.campaign.seeds)
    for task in sorted(stored.worlds):
        played = Counter(
            (episode.variation, episode.seed) for episode in stored.episodes if episode.task == task
        )
        twice = [key for key, times in played.items() if times > 1]
        if twice:
            yield f"episodes of {task}: variation {twice[0][0]} is there twice on seed {twice[0][1]}"
        stray = sorted(seed for _, seed in played if seed not in seeds)
        if stray:
            yield f"episodes of {task}: seed {shown(stray[0])} is not among the seeds {stored.campaign.seeds}"
        per_seed = Counter(seed for _, seed in played)
        variations = len(get_task(task).spec.variations)
        most = max(per_seed.values())
        wrong = next((seed for seed in seeds if per_seed[seed] != most or most not in (1, variations)), None)
        if wrong is not None:
            yield (
                f"episodes of {task}: there are {per_seed[wrong]} on seed {wrong}, but must be one, or one of each of "
                f"{variations} variations, on each of the seeds {stored.campaign.seeds}"
            )


def _faults_of_rates(stored: StoredCertificate) -> Iterator[str]:
    computed = stored.campaign.rate_rows()
    listed = [(row.get("task"), row.get("variation")) for row in stored.rates]
    wanted = [(row["task"], row["variation"]) for row in computed]
    if listed != wanted:
        yield f"rates is of {shown(listed)}, but the episodes are of {shown(wanted)}"
        return
    for row, truth in zip(stored.rates, computed, strict=True):
        place = f"rates of {truth['task']}, variation {truth['variation']}"
        if set(row) - {"coupling", *MEASURED} != set(truth):
            yield f"{place}: its fields are {shown(sorted(row))}, but must be {', '.join(truth)}"
            return
        for name, value in truth.items():
            if row[name] != value or isinstance(row[name], bool):
                yield f"{place}: {name} is {shown(row[name])}, but the episodes give {shown(value)}"
        has_evidence = stored.campaign.control in EXPERTS and truth["successes"] > 0
        if missing := [name for name in MEASURED if (name in row) != has_evidence]:
            yield f"{place}: {missing[0]} must be there just if an expert solved an episode"
        elif has_evidence:
            said = [text for text in stored.complaints if text.startswith(f"{truth['task']} ")]
            said = [text for text in said if f" (variation {truth['variation']}): " in text]
            faults = [*_faults_of_strain(row["strain"])]
            if not stored.campaign.discretise:
                faults += _unmentioned_strain(truth["task"], row["strain"], said)
            yield from (f"{place}: {fault}" for fault in faults)


def _faults_of_strain(value: Any) -> Iterator[str]:
    strain = decode(Strain, value, "strain")
    for name in BOUNDS:
        number = getattr(strain, name)
        if not 0 <= number < math.inf:
            yield f"strain.{name} is {number}, but must be at least 0"
    if bool(strain.penetrating) != (strain.penetration_mm > 0):
        yield f"strain.penetrating is {shown(strain.penetrating)}, but must name two bodies just if two penetrate"


def _unmentioned_strain(task: str, value: Any, complaints: Sequence[str]) -> Iterator[str]:
    """What is beyond its bound although none of the variation's complaints says so."""
    for name, excess in excesses(task, Strain(**value)):
        if not any(f": {name} is " in complaint for complaint in complaints):
            yield f"strain.{excess}, and complaints does not say so"
