"""What a task is: a row of data, a way to place its props, and a script that solves it.

Nothing here imports MuJoCo, so listing tasks and reading their instructions is cheap.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.placement import place_and_rehearse

if TYPE_CHECKING:
    from lerobot_env_bimanual.conditions import Condition
    from lerobot_env_bimanual.episode.rehearsal import Rehearsal
    from lerobot_env_bimanual.props.prop import Prop
    from lerobot_env_bimanual.world.scene import Scene


class Prehension(StrEnum):
    """Whether the task is done by grasping, without grasping, or by both in turn."""

    PREHENSILE = "prehensile"
    NON_PREHENSILE = "non_prehensile"
    MIXED = "mixed"


@dataclass(frozen=True)
class Taxonomy:
    """A task's row of the PerAct2 paper's table of bimanual coordination."""

    temporal: bool
    spatial: bool
    physical: bool
    symmetric: bool
    synchronous: bool
    prehension: Prehension

    @property
    def suites(self) -> tuple[str, ...]:
        """Names of the suites that a task with this row belongs to, apart from `all`."""
        couplings = tuple(name for name in ("temporal", "spatial", "physical") if getattr(self, name))
        return (
            *couplings,
            "symmetric" if self.symmetric else "asymmetric",
            "synchronous" if self.synchronous else "asynchronous",
            str(self.prehension),
        )


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
class Stage:
    """A movement of both arms between two keyposes, followed by the gripper events.

    Attributes:
        name: what happens, for failure reports.
        left: pose of the left tool centre point at the end, world frame; `None` stays where it was sent.
        right: the same of the right arm.
        left_open: state of the left gripper after the movement; `None` keeps it.
        right_open: the same of the right arm.
        planned: move through free space around obstacles; otherwise along straight lines into contact.
        left_holds: the prop that moves with the left hand from the end of this stage on, as far as a
            rehearsal without physics can know; it stays held until the gripper opens.
        right_holds: the same of the right hand.
        presses: the prop that the hands press against at the end, and which therefore keeps them from arriving.
    """

    name: str
    left: Pose | None = None
    right: Pose | None = None
    left_open: bool | None = None
    right_open: bool | None = None
    planned: bool = False
    left_holds: str | None = None
    right_holds: str | None = None
    presses: str | None = None

    def keypose(self, previous: BimanualKeypose) -> BimanualKeypose:
        """The target of both arms, with what the stage leaves open taken from the `previous` target."""
        return BimanualKeypose(
            left=self._arm_keypose(previous.left, self.left, self.left_open),
            right=self._arm_keypose(previous.right, self.right, self.right_open),
        )

    def _arm_keypose(self, previous: Keypose, pose: Pose | None, is_open: bool | None) -> Keypose:
        return replace(
            previous,
            pose=previous.pose if pose is None else pose,
            gripper_open=previous.gripper_open if is_open is None else is_open,
            ignore_collisions=not self.planned,
        )

    def holds(self, arm: Arm) -> str | None:
        """The prop that `arm` grasps at the end of this stage."""
        return self.left_holds if arm is Arm.LEFT else self.right_holds


@dataclass(frozen=True)
class TaskSpec:
    """A task as data; tables, tests and documentation are generated from it.

    Attributes:
        name: snake_case, also the module's name.
        id: position in the PerAct2 paper's list of tasks; part of every episode's seed, never reused.
        instructions: sentence templates over `Variation.words`; the first one is canonical.
        variations: one row per variation, in order of their index.
        taxonomy: how the two arms depend on each other.
        props: the things of the scene besides robots and table.
        success: conditions that all have to hold; see `Task.conditions` for those of one variation.
        horizon_ticks: control ticks (50 ms) until an episode is truncated, about 1.5 times the expert's longest.
        needs_both_arms: whether the PerAct2 paper says that one arm alone cannot do it.
    """

    name: str
    id: int
    instructions: tuple[str, ...]
    variations: tuple[Variation, ...]
    taxonomy: Taxonomy
    props: tuple[Prop, ...]
    success: tuple[Condition, ...]
    horizon_ticks: int
    needs_both_arms: bool = False

    def instructions_for(self, variation: Variation) -> tuple[str, ...]:
        """All sentences of a variation, the canonical one first."""
        return tuple(template.format(**variation.words) for template in self.instructions)


class Task(ABC):
    """One of the benchmark's tasks: its specification, its placement and its expert.

    Attributes:
        spec: the task as data.
        draws: placements that the last reset drew until one could be rehearsed.
    """

    spec: ClassVar[TaskSpec]
    draws: int = 0
    _rehearsal: Rehearsal | None = None

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
    def script(self, scene: Scene, variation: Variation) -> Iterator[Stage]:
        """The expert: a generator that reads the scene and yields the next stage.

        It is resumed after the stage before has been executed, or rehearsed, so it may read where things
        have come to lie.
        """

    def conditions(self, variation: Variation) -> tuple[Condition, ...]:
        """Conditions of success of one variation."""
        return self.spec.success

    def check(self, scene: Scene, variation: Variation) -> dict[str, bool]:
        """Each condition's name and whether it is met now."""
        return {condition.name: condition(scene) for condition in self.conditions(variation)}

    def rehearsal(self, scene: Scene) -> Rehearsal:
        """For going through scripts in a scene without physics, with keyposes exact and rounded.

        It is kept for the next reset of the same scene.
        """
        # Here, as it needs MuJoCo, which those who only list tasks do without.
        from lerobot_env_bimanual.episode.rehearsal import Rehearsal

        if self._rehearsal is None or self._rehearsal.scene is not scene:
            self._rehearsal = Rehearsal(scene, codecs=(None, KeyposeCodec()))
        return self._rehearsal

    def reset(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> None:
        """Reset the scene, place the props where a rehearsal of the script succeeds, and let them settle.

        Raises:
            PlacementFailure: no draw could be rehearsed.
        """
        self.draws = 0
        self.draws = place_and_rehearse(self, scene, variation, rng)
