"""An axis of perturbation as data: its levels, and one or two functions (hooks) that change an episode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.registry import AXES, AXES_DATA
from lerobot_env_bimanual.task import Task, TaskSpec
from lerobot_env_bimanual.world.appearance import Appearance
from lerobot_env_bimanual.world.scene import Scene

type Image = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""RGB (height, width, 3) and depth (height, width) in metres along the optical axis; 0 where none was measured."""
type Action = NDArray[np.float32]
"""Joint action (16,)."""

type Group = Literal["seen", "clutter", "bodies", "arms", "words", "time"]


@dataclass(frozen=True)
class HookContext[Memory]:
    """The argument of a hook: an episode at one of its ticks, the level's magnitude, and a generator of the axis's own.

    Attributes:
        axis: the axis whose hook is called.
        magnitude: magnitude of the level.
        rng: generator seeded by axis, hook and episode; for `command` also by the tick, for `see` also by tick and camera. It
            draws the same numbers at every level, so that levels differ only in magnitude.
        scene: the world.
        progress: the episode.
    """

    axis: Axis[Memory]
    magnitude: float
    rng: np.random.Generator
    scene: Scene
    progress: EpisodeProgress

    @property
    def memory(self) -> Memory:
        """What the axis remembers of the episode; None, whatever its type says, where nothing was remembered."""
        return cast("Memory", self.progress.memory.get(self.axis.name))

    def remember(self, memory: Memory) -> None:
        """Keep something for later ticks of the episode, or None to forget it."""
        self.progress.memory[self.axis.name] = memory


@dataclass(frozen=True)
class Start[Memory](HookContext[Memory]):
    """The start of an episode, after its props were placed and before they come to rest.

    Attributes:
        task: task of the episode.
        cameras: names of the cameras in the observation.
        is_feasible: rehearses the task's script in the present scene; returns whether both arms can execute it.
    """

    task: Task
    cameras: Sequence[str]
    is_feasible: Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Axis[Memory]:
    """One way to change the world in three levels; placement, variation and instruction of every seed stay the same.

    Attributes:
        name: snake_case.
        group: kind of what it changes: seen, clutter, bodies, arms, words or time.
        levels: magnitudes of the levels 1, 2 and 3.
        unit: of the magnitudes.
        summary: what is done, in a sentence.
        source: where the magnitudes come from.
        applies_to: whether a task, with its world before it is compiled, has what is changed here.
        build: changes the world before it is compiled, by the magnitude.
        begin: changes the start of an episode, by methods of the scene or in its progress.
        look: the appearance of an episode, given the appearance that the axes before have made.
        see: the image that a camera, given by name, hands out; the image may be changed in place.
        command: the joint action that the arms are given; the action must not be changed in place.
        disturb: changes the world after a tick, and counts in `progress.disturbances` when it has moved things. Keyposes and
            the joint actions that execute them meet the same changes.
        for_training: whether it is meant for demonstrations alone, so that tests and sweeps leave it out.
        late_ticks: ticks by which commands arrive late at a magnitude; a keypose's motion is extended by as many.
    """

    name: str
    group: Group
    levels: tuple[float, float, float]
    unit: str
    summary: str
    source: str
    applies_to: Callable[[TaskSpec, mujoco.MjSpec], bool] = lambda task, model: True
    build: Callable[[mujoco.MjSpec, float], None] | None = None
    begin: Callable[[Start[Memory]], None] | None = None
    look: Callable[[Start[Memory], Appearance], Appearance] | None = None
    see: Callable[[HookContext[Memory], str, Image], Image] | None = None
    command: Callable[[HookContext[Memory], Action], Action] | None = None
    disturb: Callable[[HookContext[Memory]], None] | None = None
    for_training: bool = False
    late_ticks: Callable[[float], int] = lambda magnitude: 0

    @property
    def changes_only_observations(self) -> bool:
        """Whether it changes only what is seen and said, and so no state."""
        return self.group in ("seen", "words")


def data(name: str) -> dict[str, Any]:
    """The arguments of `Axis` besides its functions, from `axes.toml`, for an axis of this package."""
    row = {key: value for key, value in AXES_DATA[name].items() if key != "module"}
    return row | {"name": name, "levels": tuple(row["levels"])}


def register[Memory](axis: Axis[Memory]) -> Axis[Memory]:
    """Add an axis to the registry, and return it.

    Raises:
        ValueError: another axis has the same name, or it has not three levels, is of no group, or does nothing.
    """
    if len(axis.levels) != MAX_LEVEL:
        raise ValueError(f"levels are {axis.levels}, but must be {MAX_LEVEL} magnitudes")
    if axis.group not in (groups := get_args(Group.__value__)):
        raise ValueError(f"group is {axis.group!r}, but must be one of: {', '.join(groups)}")
    if not (axis.build or axis.begin or axis.look or axis.see or axis.command or axis.disturb):
        raise ValueError("the axis changes nothing: give it build, begin, look, see, command or disturb")
    if axis.changes_only_observations and (axis.command or axis.disturb):
        raise ValueError(f"group is {axis.group!r}, which moves nothing, but the axis has command or disturb")
    AXES.add(axis.name, axis)
    return axis
