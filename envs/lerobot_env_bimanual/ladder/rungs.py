"""Which rungs the ladder of a task has."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.ladder.result import AxisRecord
from lerobot_bimanual.perturbation_levels import MAX_LEVEL, levels_text
from lerobot_env_bimanual.perturbations.axis import Axis
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.arena import build_spec

UPPER_LEVELS = tuple(range(1, MAX_LEVEL + 1))


@dataclass(frozen=True)
class Rungs:
    """The rungs that were asked for.

    Attributes:
        axes: those that apply to the task, sorted by name.
        not_applicable: names of those that do not.
        levels: rising; level 0 is always played, and not among them.
    """

    axes: tuple[Axis, ...]
    not_applicable: tuple[str, ...]
    levels: tuple[int, ...]

    def __iter__(self) -> Iterator[tuple[str, int]]:
        """Axis and level of each rung: level 0, which is of no axis, then by axis."""
        yield "", 0
        yield from ((axis.name, level) for axis in self.axes for level in self.levels)

    @property
    def seen_only(self) -> frozenset[str]:
        """Axes that change what is seen or said and no state, so that whoever does not look plays as at level 0."""
        return frozenset(axis.name for axis in self.axes if axis.changes_only_observations)

    def played_as(self, axis: str, level: int) -> tuple[str, int]:
        """The rung whose episodes are those of the expert and the blind control here."""
        return ("", 0) if axis in self.seen_only else (axis, level)

    def records(self) -> dict[str, AxisRecord]:
        """The axes as results keep them, by name."""
        return {
            axis.name: AxisRecord(axis.name, str(axis.group), axis.unit, axis.levels) for axis in self.axes
        }


def rungs_of(task: str, axes: Sequence[str] = (), levels: Sequence[int] = UPPER_LEVELS) -> Rungs:
    """The rungs of a task.

    Args:
        task: its name.
        axes: names; all that apply if none is given.
        levels: 1 to 3.

    Raises:
        UnknownTask: no such task.
        InvalidChoice: no such axis or level.
        BimanualError: none of the axes applies to the task.
    """
    spec = get_task(task).spec
    for level in levels:
        if level not in UPPER_LEVELS:
            raise InvalidChoice("levels", level, map(str, UPPER_LEVELS))
    if not levels:
        raise InvalidChoice("levels", "", map(str, UPPER_LEVELS))
    for name in axes:
        if name not in list_axes():
            raise InvalidChoice("axes", name, list_axes())
    model = build_spec(spec.props, PANDA_PAIR)
    chosen = [get_axis(name) for name in sorted(set(axes or list_axes()))]
    applicable = [axis for axis in chosen if axis.applies_to(spec, model)]
    if not applicable:
        raise BimanualError(f"none of the axes {', '.join(axes)} finds anything to change in {task}")
    left_out = [axis.name for axis in chosen if axis not in applicable]
    return Rungs(tuple(applicable), tuple(left_out), tuple(sorted(set(levels))))


def perturb_text(axis: str, level: int) -> str:
    """A rung as the option `perturb` takes it; empty at level 0."""
    return levels_text({axis: level} if axis else {})
