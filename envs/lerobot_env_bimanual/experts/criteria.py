"""What a campaign must show for a task to count as certified."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.experts.control_names import EXPERTS
from lerobot_env_bimanual.experts.outcome import Outcome
from lerobot_env_bimanual.experts.strain import excesses
from lerobot_env_bimanual.tasks.registry import get_task

MIN_EXPERT_RATE = 0.99
MIN_DISCRETISED_RATE = 0.97
MAX_RATES = {
    "noop": 0.0,
    "blind": 0.20,
    "language_blind": 1.0,
}
"""Of a control; with 1 it is measured and not limited. Of random keyposes the task itself says it (`TaskSpec.random_rate`)."""
MIN_KEYFRAMES_FOUND = 0.95


def rates(outcomes: Sequence[Outcome]) -> dict[tuple[str, int], SuccessRate]:
    """Success rate per task and variation, sorted."""
    successes: dict[tuple[str, int], list[bool]] = defaultdict(list)
    for outcome in outcomes:
        successes[outcome.task, outcome.variation].append(outcome.success)
    return {key: SuccessRate(sum(successes[key]), len(successes[key])) for key in sorted(successes)}


def complaints(control: str, discretise: int, outcomes: Sequence[Outcome]) -> list[str]:
    """Why a campaign is not good enough; empty if it is.

    An expert must succeed in 99 % of the episodes of every variation, 97 % with rounded keyposes, arrive at every
    keypose, replay, and leave keyframes that are found again in 95 % of a task's episodes; with exact keyposes, of which
    datasets are made, it must stay within what the real arm allows. (Half a voxel beside a handle that guides the hand, a
    stiff arm presses harder.) Holding still must never succeed, random keyposes in no more episodes than the task says (none, for
    most), and mean keyposes in at most 20 % of a task's episodes. How far one arm gets, and whoever does not read, is measured and not limited. Nothing may
    be unstable.
    """
    if control in EXPERTS:
        found = [*_too_rare(outcomes, MIN_DISCRETISED_RATE if discretise else MIN_EXPERT_RATE)]
        found += _flaws_of_experts(outcomes)
        if not discretise:
            found += _excessive_strain(outcomes)
    else:
        found = [*_too_frequent(control, outcomes)]
    unstable = [outcome for outcome in outcomes if outcome.unstable]
    return found + [f"{_episode(outcome)}: the simulation was unstable" for outcome in unstable]


def _too_rare(outcomes: Sequence[Outcome], least: float) -> Iterator[str]:
    for (task, variation), rate in rates(outcomes).items():
        if rate.successes < least * rate.trials:
            yield f"{task}, variation {variation}: {rate.successes}/{rate.trials} is less than {least:.0%}"


def _flaws_of_experts(outcomes: Sequence[Outcome]) -> Iterator[str]:
    keyframes: dict[str, list[bool]] = defaultdict(list)
    for outcome in outcomes:
        for report in outcome.keyposes:
            if outcome.success and not report.arrived:
                errors = " and ".join(f"{error:.0f}" for error in report.tip_error_mm)
                yield f"{_episode(outcome)}: at {report.name!r} the hands ended {errors} mm from their targets"
        if outcome.success and outcome.evidence is not None:
            keyframes[outcome.task].append(outcome.evidence.keyframes_found)
            if outcome.evidence.replayed is False:
                yield f"{_episode(outcome)}: its replay went through other states"
    for task, found in keyframes.items():
        if sum(found) < MIN_KEYFRAMES_FOUND * len(found):
            yield f"{task}: keyframe discovery is right in {sum(found)} of {len(found)} episodes"


def _excessive_strain(outcomes: Sequence[Outcome]) -> Iterator[str]:
    for outcome in outcomes:
        if outcome.evidence is not None:
            for _, excess in excesses(outcome.task, outcome.evidence.strain):
                yield f"{_episode(outcome)}: {excess}"


def _too_frequent(control: str, outcomes: Sequence[Outcome]) -> Iterator[str]:
    successes: dict[str, list[bool]] = defaultdict(list)
    for outcome in outcomes:
        successes[outcome.task].append(outcome.success)
    for task, successful in successes.items():
        most = get_task(task).spec.random_rate if control == "random" else MAX_RATES[control]
        if sum(successful) > most * len(successful):
            yield f"{task}: {control} succeeds in {sum(successful)} of {len(successful)} episodes"


def _episode(outcome: Outcome) -> str:
    return f"{outcome.task} {outcome.split} seed {outcome.seed} (variation {outcome.variation})"
