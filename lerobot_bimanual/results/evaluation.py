"""All episodes of one evaluation of one task, as a JSON file."""

import platform
from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from lerobot_bimanual.results.episode import ProvedEpisodes
from lerobot_bimanual.results.record import Record
from lerobot_bimanual.versions import STAMPED_PACKAGES, installed_versions

RESULT_PACKAGES = (*STAMPED_PACKAGES, "lerobot_policy_bimanual", "torch")

WorldVersion = Annotated[str, Field(pattern="^[0-9a-f]{12}$")]
"""Version of what a task's world does, as its expert reports have it."""


class EvaluationRecord(Record):
    """One evaluation of one task.

    Attributes:
        schema_version: version of these fields.
        task: name of the task.
        world: version of what the task's world does.
        options: options of the environment that decide what is played and seen, by name.
        batch_size: environments side by side. A network's answers differ in their last bits between batch sizes, so a
            policy gives the same episodes again only with the same one.
        versions: package -> version.
        episodes: played episodes with their proofs, sorted by seed.
    """

    schema_version: Literal[2]
    task: str
    world: WorldVersion
    options: dict[str, str | int]
    batch_size: PositiveInt
    versions: dict[str, str]
    episodes: ProvedEpisodes

    @property
    def perturb(self) -> str:
        """Perturbations of the world, `AXIS:LEVEL,...`; empty for the nominal world."""
        return str(self.options.get("perturb", ""))


def perturbed(name: str, perturb: str) -> str:
    """A name with the perturbations of its world, `AXIS:LEVEL,...`; the name itself in the nominal world."""
    return f"{name}_{perturb.replace(':', '')}" if perturb else name


def eval_key(task: str, variation: str | int, perturb: str) -> str:
    """Name of what a policy is scored on: a task, or one variation of it, with its perturbations."""
    return perturbed(task if variation == "any" else f"{task}_{variation}", perturb)


def result_versions() -> dict[str, str]:
    """Versions of Python and of the installed packages that a result depends on."""
    found = installed_versions(RESULT_PACKAGES)
    # LeRobot's own policies do without ours.
    present = {package: version for package, version in found.items() if version != "none"}
    return {"python": platform.python_version()} | present
