"""Tasks: data, a placement of props, and a script that solves the task; they keep no state."""

from __future__ import annotations

import re
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.conditions import Condition
from lerobot_env_bimanual.options import ANY_VARIATION, VARIED
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

OWN_IDS = 1000
"""Lowest id that is computed from a task's name."""

type Script = Callable[[SceneView], Iterator[Stage]]


@dataclass(frozen=True)
class Variation:
    """An integer-indexed change of colour, part or instance.

    Attributes:
        index: position in `TaskSpec.variations`.
        words: what fills the templates of the instructions, e.g. `{"color": "red"}`.
    """

    index: int = 0
    words: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class TaskSpec:
    """A task as data; tables, tests and documentation are generated from it.

    Attributes:
        name: snake_case, also the module's name.
        id: position in the PerAct2 paper's list of tasks, part of every episode's seed, never reused. Other tasks leave it out;
            their id is computed from their name.
        instructions: sentence templates over `Variation.words`; the first one is canonical.
        suites: suites of the task besides `all`: its entries in the paper's table of coordination, as words.
        props: the things of the scene besides robots and table, in the setting `standard`.
        success: conditions that all have to hold; see `Task.conditions` for those of one variation.
        horizon_ticks: control ticks (50 ms) until an episode is truncated, about 1.5 times the expert's longest.
        variations: one row per variation, in order of their index.
        varied: sets of props of the setting `varied`; each episode draws one. All have the same names in the same order. If
            there are none, `varied` uses `props`.
        needs_both_arms: whether the PerAct2 paper says that one arm alone cannot do it.
        plans: names of the expert's plans, of which both arms must follow the same one; the first is used unless another one is
            chosen, as by `dataset generate --plans=several`.
        load_bounds: bounds on the load on the expert's arms, by name, that replace those of all tasks
            (`lerobot_env_bimanual.experts.load`) where these are too low; the task's file says why.
    """

    name: str
    id: int = field(default=-1, kw_only=True)
    instructions: tuple[str, ...]
    suites: tuple[str, ...]
    props: tuple[Prop, ...]
    success: tuple[Condition, ...]
    horizon_ticks: int
    variations: tuple[Variation, ...] = (Variation(),)
    varied: tuple[tuple[Prop, ...], ...] = ()
    needs_both_arms: bool = False
    plans: tuple[str, ...] = ("usual",)
    load_bounds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Compute the id from the name if the task leaves it out."""
        if self.id < 0:
            object.__setattr__(self, "id", OWN_IDS + zlib.crc32(self.name.encode()))

    def prop_sets(self, setting: str) -> tuple[tuple[Prop, ...], ...]:
        """The sets of props among which the episodes of a setting draw."""
        return self.varied if setting == VARIED and self.varied else (self.props,)

    def variation_index(self, variation: object) -> int | None:
        """Index that an option `variation` means; `None` to draw one per episode.

        Args:
            variation: index, also as a text, or "any".

        Raises:
            InvalidChoice: the task has no such variation.
        """
        text, count = str(variation), len(self.variations)
        if text == ANY_VARIATION:
            return None
        if not re.fullmatch("[0-9]{1,4}", text) or int(text) >= count:
            valid = f"'any' or an integer from 0 to {count - 1}"
            raise InvalidChoice(f"variation of {self.name}", variation, valid)
        return int(text)

    def instructions_for(self, variation: Variation) -> tuple[str, ...]:
        """All sentences of a variation, the canonical one first."""
        return tuple(template.format(**variation.words) for template in self.instructions)


@dataclass(frozen=True)
class PlacementArea:
    """An upright rectangle on the table with a range of headings.

    Attributes:
        center_m: x and y of the middle, world frame.
        half_size_m: how far a prop's origin may lie from it along x and y.
        half_yaw_rad: how far a prop may be turned to either side about the vertical.
    """

    center_m: tuple[float, float]
    half_size_m: tuple[float, float]
    half_yaw_rad: float = 0.0

    def sample(self, rng: np.random.Generator, height_m: float) -> Pose:
        """A uniform upright pose with its origin at `height_m` above the floor."""
        xy = np.array(self.center_m) + rng.uniform(-1.0, 1.0, 2) * self.half_size_m
        return Pose.upright((*xy, height_m), rng.uniform(-1.0, 1.0) * self.half_yaw_rad)


class Task(ABC):
    """One of the benchmark's tasks: its specification, its placement and its expert."""

    spec: ClassVar[TaskSpec]

    @abstractmethod
    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Draw one placement of the props.

        Args:
            scene: pristine scene, arms at home.
            variation: what to colour or to choose.
            rng: the episode's generator, the only source of randomness.

        Returns:
            Whether the draw is legal in itself; whether the arms can do it is rehearsed afterwards.
        """

    @abstractmethod
    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """The expert: a generator that reads the scene and yields the next stage.

        It is resumed after the previous stage has been executed or rehearsed, so it may read where things are then.
        """

    def script_for_plan(self, variation: Variation, plan: int = 0) -> Script:
        """The script that follows the plan with this number; scripts of tasks with several plans have an argument `plan`."""
        return partial(self.script, variation=variation, **({"plan": plan} if plan else {}))

    def conditions(self, variation: Variation) -> tuple[Condition, ...]:
        """Conditions of success of one variation."""
        return self.spec.success

    def script_for_instruction(self, scene: SceneView, variation: Variation) -> Script | None:
        """The script that follows the instruction of another variation in this scene; None if the scene lacks its props.

        A task whose script assumes that the scene was placed for its variation overrides this method.
        """
        return partial(self.script, variation=variation)

    def scripts_for_all_instructions(self, scene: SceneView) -> list[Script]:
        """A script for every instruction that can be followed in the scene, in the order of the variations."""
        scripts = (self.script_for_instruction(scene, variation) for variation in self.spec.variations)
        return [script for script in scripts if script is not None]
