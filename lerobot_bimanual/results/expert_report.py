"""How often the expert or a baseline solves tasks, episode by episode, as a JSON file."""

import re
from collections.abc import Sequence
from functools import cached_property
from statistics import median
from typing import Annotated, Literal, NamedTuple, Self, get_args

from pydantic import Field, NonNegativeInt, PositiveInt

from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.results.episode import Episode, EpisodeCount, LoadMetrics, StateHash
from lerobot_bimanual.results.evaluation import WorldVersion
from lerobot_bimanual.results.record import Record

PlayerName = Literal[
    "expert", "replanning", "noop", "random", "open_loop", "nearest", "mixed", "language_ablated"
]
PLAYERS: tuple[PlayerName, ...] = get_args(PlayerName)
EXPERTS: tuple[PlayerName, ...] = ("expert", "replanning")
"""Players that must succeed, and whose episodes are measured; all others are baselines."""


class MoveReport(NamedTuple):
    """How one keypose went: its name, control ticks, and the distance of each tool centre point from its target in mm."""

    name: str
    ticks: int
    left_error_mm: float
    right_error_mm: float


class EpisodeOutcome(Episode):
    """An episode of an expert or a baseline, with what its moves did.

    Attributes:
        task: name of the task.
        last_move: name of the last move; empty if there was none.
        unmet: conditions of success that did not hold at the end.
        moves: one report per executed keypose.
        draws: placements drawn at the reset.
        line_fallbacks: contact moves for which there was no straight line.
        unstable: whether MuJoCo warned.
        keyframes_found: whether keyframe discovery finds the ends of all keyposes of a solved episode of an expert.
        replayed: whether a replay of such an episode went through the same states, bit for bit; None without a replay.
        commands: (18,) each, the commanded keyposes. A report leaves them out, as it does `late_moves` and `load`.
        late_moves: indices of moves at whose end a hand was away from its target without pressing what it should.
    """

    task: str
    variation: NonNegativeInt  # pyright: ignore  # always recorded here
    ticks: NonNegativeInt  # pyright: ignore
    state_hash: StateHash  # pyright: ignore
    last_move: str = ""
    unmet: tuple[str, ...] = ()
    moves: tuple[MoveReport, ...] = ()
    draws: PositiveInt = 1
    line_fallbacks: NonNegativeInt = 0
    unstable: bool = False
    keyframes_found: bool | None = None
    replayed: bool | None = None
    commands: tuple[tuple[float, ...], ...] = ()
    late_moves: tuple[NonNegativeInt, ...] = ()


class VariationLoad(Record):
    """Peak loads over the solved episodes of one variation."""

    task: str
    variation: NonNegativeInt
    load: LoadMetrics


class ExpertReport(Record):
    """Episodes of the expert or a baseline on tasks.

    Attributes:
        discretise: voxels per axis to which the expert's keyposes were rounded; 0 left them exact.
        replay: how its episodes were replayed.
        first_seed: of each task, or of each of its variations.
        n_seeds: number of consecutive seeds.
        perturb: perturbations of the world, `AXIS:LEVEL,...`.
        plan: number of the expert's plan.
        versions: package -> version.
        worlds: task -> version of its world.
        violations: criteria that the player does not meet, one sentence each.
        loads: peak loads of an expert's arms, by task and variation.
        episodes: by task, then in the order in which they were specified.
    """

    schema_version: Literal[1]
    player: PlayerName
    discretise: Annotated[int, Field(ge=0, lt=2**16)] = 0
    replay: Literal["none", "joint", "keypose"] = "none"
    split: Literal["train", "val", "test"]
    first_seed: NonNegativeInt
    n_seeds: EpisodeCount
    perturb: str = ""
    setting: Literal["standard", "varied"] = "standard"
    plan: Annotated[int, Field(ge=0, lt=2**16)] = 0
    versions: dict[str, str]
    worlds: dict[str, WorldVersion]
    violations: tuple[str, ...] = ()
    loads: tuple[VariationLoad, ...] = ()
    episodes: Annotated[tuple[EpisodeOutcome, ...], Field(min_length=1)]

    @property
    def seeds(self) -> range:
        """The seeds."""
        return range(self.first_seed, self.first_seed + self.n_seeds)

    @cached_property
    def by_variation(self) -> dict[tuple[str, int], list[EpisodeOutcome]]:
        """Episodes by task and variation, sorted."""
        return by_variation(self.episodes)

    def of_task(self, task: str) -> list[EpisodeOutcome]:
        """The episodes of one task."""
        return [episode for episode in self.episodes if episode.task == task]

    def with_tasks_of(self, other: Self) -> Self:
        """This report and the tasks of another one of the same options, which take the place of those that both have."""
        rest = self.worlds.keys() - other.worlds.keys()
        violations = [each for each in self.violations if _task_of(each) in rest]
        loads = [each for each in self.loads if each.task in rest]
        episodes = [each for each in self.episodes if each.task in rest]
        changes = {
            "worlds": dict(sorted((self.worlds | other.worlds).items())),
            "violations": tuple(sorted([*violations, *other.violations], key=_task_of)),
            "loads": tuple(sorted([*loads, *other.loads], key=lambda each: each.task)),
            "episodes": tuple(sorted([*episodes, *other.episodes], key=lambda each: each.task)),
        }
        return type(self).of(**dict(other) | changes)

    def load(self, task: str) -> LoadMetrics | None:
        """Peak loads over all variations of a task; None if they were not measured."""
        loads = [each.load for each in self.loads if each.task == task]
        return peak_load(loads) if loads else None


def _task_of(violation: str) -> str:
    """The task that a violation begins with."""
    return re.split(r"\W", violation, maxsplit=1)[0]


def by_variation(episodes: Sequence[EpisodeOutcome]) -> dict[tuple[str, int], list[EpisodeOutcome]]:
    """Episodes by task and variation, sorted."""
    found: dict[tuple[str, int], list[EpisodeOutcome]] = {}
    for episode in episodes:
        found.setdefault((episode.task, episode.variation), []).append(episode)
    return {key: found[key] for key in sorted(found)}


def median_duration_s(episodes: Sequence[EpisodeOutcome]) -> float:
    """Median duration of episodes in s, of the robots' time."""
    return median(episode.ticks for episode in episodes) / CONTROL_HZ


def worst_tip_error_mm(episodes: Sequence[EpisodeOutcome]) -> float:
    """Largest distance of a hand from its target at the end of a keypose that did not end its episode, in mm."""
    moves = [move for episode in episodes for move in episode.moves[:-1]]
    return max((max(move.left_error_mm, move.right_error_mm) for move in moves), default=0.0)


def peak_load(loads: Sequence[LoadMetrics]) -> LoadMetrics:
    """Peaks of several loads, field by field."""
    deepest = max(loads, key=lambda load: load.penetration_mm)
    names = [name for name in LoadMetrics.model_fields if name != "penetrating"]
    peaks = {name: max(getattr(load, name) for load in loads) for name in names}
    return LoadMetrics(**peaks, penetrating=deepest.penetrating)
