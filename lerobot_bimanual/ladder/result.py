"""What was played on the rungs of a ladder, as one JSON file."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import read_json, shown
from lerobot_bimanual.json_record import read
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.perturbation_levels import MAX_LEVEL, levels_text
from lerobot_bimanual.results.statistics import SuccessRate

LADDER_SCHEMA_VERSION = 1
LEAST_EXPERT_RATE = 0.97
"""On a certified rung; where the expert solves fewer, a policy's failure says nothing of the policy."""
LEVEL_0 = "level 0"
SHA256 = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class AxisRecord:
    """An axis as it was when its rungs were played.

    Attributes:
        name: of the axis.
        group: what kind of difference it makes.
        unit: of the magnitudes.
        magnitudes: of the levels 1, 2 and 3.
    """

    name: str
    group: str
    unit: str
    magnitudes: tuple[float, float, float]


@dataclass(frozen=True)
class RungEpisode:
    """One episode of the policy on one rung.

    Attributes:
        seed: of its reset.
        variation: index of its variation.
        success: whether it was solved.
        failure: why it was not; empty after a success.
        keyposes: keyposes executed.
        ticks: control ticks that it took.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    seed: int
    variation: int
    success: bool
    failure: str
    keyposes: int
    ticks: int

    def __post_init__(self) -> None:
        for name in ("seed", "variation", "keyposes", "ticks"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}, but must not be negative")
        if bool(self.failure) == self.success:
            raise ValueError("there must be a failure just if there is no success")


@dataclass(frozen=True)
class Rung:
    """One level of one axis, or level 0.

    Attributes:
        axis: its name; empty at level 0.
        level: 0 to 3; level 0 is the world as it is, and of no axis.
        world: version of what the task's world does there.
        expert: seeds that the expert solved, of those of the episodes.
        blind: seeds that the blind control solved.
        certificate: the expert on many more seeds, if a certificate was at hand; it then decides, not `expert`.
        episodes: of the policy, one per seed.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    axis: str
    level: int
    world: str
    expert: tuple[int, ...]
    blind: tuple[int, ...]
    certificate: SuccessRate | None
    episodes: tuple[RungEpisode, ...]

    def __post_init__(self) -> None:
        if not 0 <= self.level <= MAX_LEVEL or bool(self.axis) != bool(self.level):
            raise ValueError(
                f"level 0 is of no axis, levels 1 to {MAX_LEVEL} are of one; got {self.axis!r}, {self.level}"
            )
        if not self.seeds or self.seeds != sorted(set(self.seeds)):
            raise ValueError("episodes must be there, and their seeds rise")
        for who in ("expert", "blind"):
            solved = list(getattr(self, who))
            if solved != sorted(set(solved)) or not set(solved) <= set(self.seeds):
                raise ValueError(f"{who} must hold seeds of the episodes, rising")

    @property
    def name(self) -> str:
        """As `--env.perturb` takes it; at level 0 in words."""
        return rung_name(self.axis, self.level)

    @property
    def seeds(self) -> list[int]:
        """Of the episodes."""
        return [episode.seed for episode in self.episodes]

    @property
    def solved(self) -> list[bool]:
        """Success of each episode."""
        return [episode.success for episode in self.episodes]

    @property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of policy, expert and blind control."""
        played = len(self.episodes)
        return {
            "policy": SuccessRate(sum(self.solved), played),
            "expert": SuccessRate(len(self.expert), played),
            "blind": SuccessRate(len(self.blind), played),
        }

    @property
    def is_certified(self) -> bool:
        """Whether the expert solves what is asked for here."""
        rate = self.certificate or self.rates["expert"]
        return rate.successes >= LEAST_EXPERT_RATE * rate.trials


@dataclass(frozen=True)
class LadderResult:
    """One policy on the ladder of one task.

    Attributes:
        schema_version: version of this table of fields.
        task: name of the task.
        policy: type of the policy.
        checkpoint: folder of the policy, as it was called.
        checkpoint_sha256: of its `model.safetensors`.
        options: of the environment at level 0, by name.
        batch_size: environments side by side.
        versions: package -> version.
        date: day on which the first rung was played, ISO 8601.
        axes: those of which there are rungs, by name.
        not_applicable: axes that find nothing to change in the task.
        rungs: level 0, then by axis and level.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    schema_version: int
    task: str
    policy: str
    checkpoint: str
    checkpoint_sha256: str
    options: dict[str, str]
    batch_size: int
    versions: dict[str, str]
    date: str
    axes: tuple[AxisRecord, ...]
    not_applicable: tuple[str, ...]
    rungs: tuple[Rung, ...]

    def __post_init__(self) -> None:
        for field, holds, wanted in self._checks():
            if not holds:
                raise ValueError(f"{field} is {shown(getattr(self, field))}, but {wanted}")

    def _checks(self) -> Iterator[tuple[str, bool, str]]:
        yield (
            "schema_version",
            self.schema_version == LADDER_SCHEMA_VERSION,
            f"must be {LADDER_SCHEMA_VERSION}",
        )
        yield (
            "checkpoint_sha256",
            bool(SHA256.fullmatch(self.checkpoint_sha256)),
            "must be 64 hexadecimal digits",
        )
        yield "batch_size", self.batch_size >= 1, "must be at least 1"
        yield "options", {"split", "variation"} <= self.options.keys(), "must hold split and variation"
        names = [axis.name for axis in self.axes]
        yield "axes", names == sorted(set(names)), "must be sorted by name, each once"
        yield "not_applicable", not set(self.not_applicable) & set(names), "none of them can have rungs"
        keys = [(rung.axis, rung.level) for rung in self.rungs]
        yield "rungs", keys[:1] == [("", 0)], "must begin with level 0, to which all are compared"
        yield "rungs", keys == sorted(set(keys)), "must be sorted by axis and level, each once"
        yield "rungs", {axis for axis, _ in keys[1:]} == set(names), f"must be of the axes {', '.join(names)}"
        drawn = [[(episode.seed, episode.variation) for episode in rung.episodes] for rung in self.rungs]
        alike = all(episodes == drawn[0] for episodes in drawn)
        yield "rungs", alike, "must be of the same seeds, each of the same variation on all"

    @property
    def level_0(self) -> Rung:
        """The world as it is."""
        return self.rungs[0]

    @cached_property
    def by_name(self) -> Mapping[str, Rung]:
        """Each rung, by name."""
        return {rung.name: rung for rung in self.rungs}

    def of_axis(self, axis: str) -> list[Rung]:
        """The rungs of an axis, level 0 left out."""
        return [rung for rung in self.rungs if rung.axis == axis]

    def write(self, path: Path) -> None:
        """Write a JSON file with one episode per line.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        content = asdict(self)
        rungs = ",\n  ".join(_lines(rung) for rung in content.pop("rungs"))
        head = json.dumps(content, indent=1).removesuffix("\n}")
        write_file(path, f'{head},\n "rungs": [\n  {rungs}\n ]\n}}\n')

    @classmethod
    def read(cls, path: Path) -> Self:
        """The ladder in a file.

        Raises:
            BimanualError: the file cannot be read, or is no such result; the message names it.
        """
        return read(cls, path, "ladder")


def rung_name(axis: str, level: int) -> str:
    """A rung as `--env.perturb` takes it; level 0 in words."""
    return levels_text({axis: level}) or LEVEL_0


def short_name(name: str, ladder: LadderResult) -> str:
    """The name of a ladder without its task, where it begins with that, so that those of several tasks go by one."""
    return name.removeprefix(f"{ladder.task}_")


def is_ladder(path: Path) -> bool:
    """Whether a file looks like the result of a ladder, be it a damaged one."""
    try:
        content = read_json(path)
    except BimanualError:
        return False
    return isinstance(content, dict) and "rungs" in content


def _lines(rung: dict[str, Any]) -> str:
    """A rung with one episode per line."""
    episodes = ",\n    ".join(json.dumps(episode) for episode in rung.pop("episodes"))
    return f'{json.dumps(rung).removesuffix("}")}, "episodes": [\n    {episodes}\n   ]}}'
