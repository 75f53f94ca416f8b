"""All episodes of one evaluation of one task, as a JSON file."""

import hashlib
import platform
from collections.abc import Container, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, PositiveInt

from lerobot_bimanual.distributions import STAMPED_PACKAGES, installed_versions
from lerobot_bimanual.results.episode import ProvedEpisodes
from lerobot_bimanual.results.record import Record

RESULT_PACKAGES = (*STAMPED_PACKAGES, "lerobot_policy_bimanual", "torch")

STANDARD = "standard"
"""The setting with the paper's things; only others are part of names."""

VERSION_DIGITS = 12
WorldVersion = Annotated[str, Field(pattern=f"^[0-9a-f]{{{VERSION_DIGITS}}}$")]
"""Version of what a task's world does, as its expert reports have it."""


def combined_version(worlds: Mapping[str, str]) -> str:
    """One version for the worlds of several tasks, given each one's."""
    text = "\n".join(f"{task} {worlds[task]}" for task in sorted(worlds))
    return hashlib.sha256(text.encode()).hexdigest()[:VERSION_DIGITS]


class EvaluationHead(Record):
    """What identifies an evaluation of one task; evaluations with equal heads may share their episodes.

    Attributes:
        world: version of what the task's world does.
        options: options of the environment that decide what is played and seen, by name.
        batch_size: environments side by side. A network's answers differ in their last bits between batch sizes, so a
            policy gives the same episodes again only with the same one.
        versions: package -> version.
        policy: what played: `type`, `sha256` of its config and files, and `seed` of its random numbers. Empty where the
            environment was not told.
    """

    schema_version: Literal[2]
    task: str
    world: WorldVersion
    options: dict[str, str | int]
    batch_size: PositiveInt
    versions: dict[str, str]
    policy: dict[str, str | int] = Field(default={})

    def difference(self, other: "EvaluationHead") -> str | None:
        """The first difference from another head in words; None if they are of one evaluation."""
        for name in EvaluationHead.model_fields:
            theirs, ours = getattr(other, name), getattr(self, name)
            if theirs == ours:
                continue
            if not isinstance(ours, dict):
                return f"its {name} is {theirs!r}, not {ours!r}"
            key = next(key for key in sorted(theirs | ours) if theirs.get(key) != ours.get(key))
            return f"{key} of its {name} is {theirs.get(key)!r}, not {ours.get(key)!r}"
        return None


class EvaluationRecord(EvaluationHead):
    """One evaluation of one task: its played episodes with their proofs, sorted by seed."""

    episodes: ProvedEpisodes

    @property
    def perturb(self) -> str:
        """Perturbations of the world, `AXIS:LEVEL,...`; empty for the nominal world."""
        return str(self.options.get("perturb", ""))

    @property
    def setting(self) -> str:
        """Setting of the episodes."""
        return str(self.options.get("setting", STANDARD))

    @property
    def eval_key(self) -> str:
        """Name of what was played: the task, or one variation of it, with its setting and perturbations."""
        return eval_key(self.task, self.options.get("variation", "any"), self.perturb, self.setting)

    @property
    def policy_id(self) -> str:
        """Type of the policy; `unnamed` if the environment was not told."""
        return str(self.policy.get("type", "unnamed"))

    def of_seeds(self, seeds: Container[int]) -> Self:
        """The record without episodes of other seeds, such as those that filled up the last batch."""
        episodes = tuple(episode for episode in self.episodes if episode.seed in seeds)
        return self.model_copy(update={"episodes": episodes})


def with_perturb_suffix(name: str, perturb: str) -> str:
    """A name with the perturbations of its world, `AXIS:LEVEL,...`; the name itself in the nominal world."""
    return f"{name}_{perturb.replace(':', '')}" if perturb else name


def eval_key(task: str, variation: str | int, perturb: str, setting: str = STANDARD) -> str:
    """Name of what a policy is scored on: a task, or one variation of it, with its setting and perturbations."""
    name = task if setting == STANDARD else f"{task}_{setting}"
    return with_perturb_suffix(name if variation == "any" else f"{name}_{variation}", perturb)


def result_versions() -> dict[str, str]:
    """Versions of Python and of the installed packages that a result depends on."""
    found = installed_versions(RESULT_PACKAGES)
    # LeRobot's own policies do without ours.
    present = {package: version for package, version in found.items() if version != "none"}
    return {"python": platform.python_version()} | present
