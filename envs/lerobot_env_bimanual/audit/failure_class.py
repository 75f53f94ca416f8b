"""Why an episode failed, by rules from physics and commands alone.

What should have been gripped and touched is known from the expert's own episode of the same seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.audit.witness import EpisodeFacts
from lerobot_env_bimanual.experts.load import bounds_of
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION

COLLISION_FACTOR = 2.0
"""Over the task's bound on what an expert may push with: 200 N, where no task has a bound of its own."""
NAMES_OF_ARMS = ("left arm: ", "right arm: ", "both arms: ")
"""Begin the failure of an episode that ended by a keypose that could not be reached."""


class FailureClass(StrEnum):
    """Kinds of failure; of several that apply, the first counts, and of dropped and missed what happened first."""

    INVALID_ACTION = "invalid action"
    UNREACHABLE = "unreachable"
    COLLISION = "collision"
    WRONG_OBJECT = "wrong object"
    DROPPED = "dropped"
    MISSED_GRASP = "missed grasp"
    OUT_OF_STEP = "arms out of step"
    OUT_OF_TIME = "out of time"


def failure_class(task: str, facts: EpisodeFacts, expert: EpisodeFacts) -> tuple[FailureClass, str]:
    """The class of a failed episode, and the fact that decided.

    Args:
        task: name of the task.
        facts: of the episode.
        expert: of the expert's episode of the same seed and variation.
    """
    return next(_classes(task, facts, expert))


def _classes(task: str, facts: EpisodeFacts, expert: EpisodeFacts) -> Iterator[tuple[FailureClass, str]]:
    """All that apply, in order of precedence."""
    if facts.failure.startswith(INVALID_ACTION):
        yield FailureClass.INVALID_ACTION, facts.failure.removeprefix(INVALID_ACTION)
    if facts.failure.startswith(NAMES_OF_ARMS):
        yield FailureClass.UNREACHABLE, facts.failure
    if facts.unstable:
        yield FailureClass.COLLISION, "the simulation became unstable"
    most_n = COLLISION_FACTOR * bounds_of(task)["contact_force_n"]
    if facts.contact_force_n > most_n:
        yield (
            FailureClass.COLLISION,
            f"an arm pushed with {facts.contact_force_n:.0f} N, above {most_n:.0f} N",
        )
    for other in sorted(facts.others_met - expert.others_met):
        yield FailureClass.WRONG_OBJECT, f"{other} was met, which nobody asked for"
    for arm, thing in sorted(facts.gripped):
        if thing not in expert.touched:
            yield FailureClass.WRONG_OBJECT, f"the {arm} hand held {thing}, which the expert does not touch"
    yield from _failed_grips(facts, expert)
    if not facts.unmet and not facts.met_together:
        yield FailureClass.OUT_OF_STEP, "each condition held at some tick, but never all together"
    held = "all held together, but not for half a second" if facts.met_together else ""
    yield FailureClass.OUT_OF_TIME, held or f"never met: {', '.join(facts.unmet)}"


def _failed_grips(facts: EpisodeFacts, expert: EpisodeFacts) -> Iterator[tuple[FailureClass, str]]:
    """What was dropped or missed, in the order in which it happened: each may be the other's consequence."""
    happened: list[tuple[int, FailureClass, str]] = []
    gripped_by_expert = {thing for _, thing in expert.gripped}
    for thing, tick in facts.lost.items():
        if thing in gripped_by_expert:
            happened.append((tick, FailureClass.DROPPED, f"{thing} was lost at tick {tick}"))
    for arm, tick in facts.closed.items():
        due = _gripped_by(expert, arm)
        if due and not due & _gripped_by(facts, arm):
            fact = f"the {arm} hand closed at tick {tick}, and never held {', '.join(sorted(due))}"
            happened.append((tick, FailureClass.MISSED_GRASP, fact))
    for _, kind, fact in sorted(happened):
        yield kind, fact


def _gripped_by(facts: EpisodeFacts, arm: Arm) -> set[str]:
    return {thing for hand, thing in facts.gripped if hand is arm}
