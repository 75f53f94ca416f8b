"""Classes of failure, decided by rules from physics and commands.

The expert's episode of the same seed tells which bodies should have been gripped and touched.
"""

from collections.abc import Iterator
from enum import StrEnum

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.experts.load import bounds_of
from lerobot_env_bimanual.failures.monitor import EpisodeEvents
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION
from lerobot_env_bimanual.worlds import PROTECTIVE_STOP

COLLISION_FACTOR = 2.0
"""Times the force with which an expert may push in the task: 200 N, unless the task has a bound of its own."""
ARM_PREFIXES = ("left arm: ", "right arm: ", "both arms: ")
"""Beginnings of the failure of an episode that ended by a keypose out of reach."""


class FailureClass(StrEnum):
    """Classes of failure in order of precedence; between dropped and missed grasp the earlier event decides."""

    INVALID_ACTION = "invalid action"
    UNREACHABLE = "unreachable"
    COLLISION = "collision"
    WRONG_OBJECT = "wrong object"
    DROPPED = "dropped"
    MISSED_GRASP = "missed grasp"
    OUT_OF_STEP = "arms out of step"
    OUT_OF_TIME = "out of time"


def classify(task: str, events: EpisodeEvents, expert: EpisodeEvents) -> tuple[FailureClass, str]:
    """The class of a failed episode, and the event that decided, given the events of the expert in the same scene."""
    return next(_classes(task, events, expert))


def _classes(task: str, events: EpisodeEvents, expert: EpisodeEvents) -> Iterator[tuple[FailureClass, str]]:
    """All classes that apply, in order of precedence."""
    if events.failure.startswith(INVALID_ACTION):
        yield FailureClass.INVALID_ACTION, events.failure.removeprefix(INVALID_ACTION)
    if events.failure.startswith(ARM_PREFIXES):
        yield FailureClass.UNREACHABLE, events.failure
    if events.unstable:
        yield FailureClass.COLLISION, "the simulation became unstable"
    if events.failure.startswith(PROTECTIVE_STOP):
        yield FailureClass.COLLISION, events.failure
    max_n = COLLISION_FACTOR * bounds_of(task)["contact_force_n"]
    if events.contact_force_n > max_n:
        event = f"an arm pushed with {events.contact_force_n:.0f} N, above {max_n:.0f} N"
        yield FailureClass.COLLISION, event
    for other in sorted(events.others_met - expert.others_met):
        yield FailureClass.WRONG_OBJECT, f"{other} was met, which is not the instruction"
    for arm, body in sorted(events.gripped):
        if body not in expert.touched:
            yield FailureClass.WRONG_OBJECT, f"the {arm} hand held {body}, which the expert does not touch"
    yield from _failed_grips(events, expert)
    if not events.unmet and not events.met_together:
        yield FailureClass.OUT_OF_STEP, "each condition held at some tick, but never all together"
    held = "all held together, but not for half a second" if events.met_together else ""
    yield FailureClass.OUT_OF_TIME, held or f"never met: {', '.join(events.unmet)}"


def _failed_grips(events: EpisodeEvents, expert: EpisodeEvents) -> Iterator[tuple[FailureClass, str]]:
    """Drops and missed grasps in the order in which they happened: each may be a consequence of the other."""
    happened: list[tuple[int, FailureClass, str]] = []
    gripped_by_expert = {body for _, body in expert.gripped}
    for body, tick in events.lost.items():
        if body in gripped_by_expert:
            happened.append((tick, FailureClass.DROPPED, f"{body} was lost at tick {tick}"))
    for arm, tick in events.closed.items():
        due = _gripped_by(expert, arm)
        if due and not due & _gripped_by(events, arm):
            event = f"the {arm} hand closed at tick {tick}, and never held {', '.join(sorted(due))}"
            happened.append((tick, FailureClass.MISSED_GRASP, event))
    for _, kind, event in sorted(happened):
        yield kind, event


def _gripped_by(events: EpisodeEvents, arm: Arm) -> set[str]:
    return {body for hand, body in events.gripped if hand is arm}
