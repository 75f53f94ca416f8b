"""Expert reports: the criteria that a player must meet, and how a report is made and printed."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import pandas as pd
from rich.console import Console

from lerobot_bimanual.results.episode import success_rate
from lerobot_bimanual.results.expert_report import (
    EXPERTS,
    EpisodeOutcome,
    ExpertReport,
    PlayerName,
    VariationLoad,
    by_variation,
    median_duration_s,
    peak_load,
    worst_tip_error_mm,
)
from lerobot_bimanual.terminal import print_table
from lerobot_env_bimanual.experts.load import excesses
from lerobot_env_bimanual.experts.world_version import simulation_versions, world_versions
from lerobot_env_bimanual.options import STANDARD

type Split = Literal["train", "val", "test"]

MIN_EXPERT_RATE = 0.99
MIN_DISCRETISED_RATE = 0.97
MAX_RATES: dict[PlayerName, float] = {
    "noop": 0.0,
    "random": 0.0,
    "open_loop": 0.10,
    "nearest": 1.0,
    "mixed": 1.0,
    "language_ablated": 1.0,
}
"""Highest success rate of a baseline; with 1 it is measured and not limited."""
MIN_KEYFRAMES_FOUND = 0.95
STATE_HASH_DIGITS = 16
"""Stored digits of each state hash, enough to tell all episodes apart."""


def make_report(
    outcomes: Sequence[EpisodeOutcome], player: PlayerName, split: Split, **head: Any
) -> ExpertReport:
    """The report of all episodes of a player.

    `head` holds further fields of `ExpertReport`: `discretise`, `replay`, `first_seed`, `n_seeds`, `perturb` and `setting`.
    """
    loads = (
        VariationLoad(task=task, variation=variation, load=peak_load(found))
        for (task, variation), episodes in by_variation(outcomes).items()
        if (found := [episode.load for episode in episodes if episode.load is not None])
    )
    tasks = sorted({outcome.task for outcome in outcomes})
    left_out: dict[str, Any] = {"commands": (), "late_moves": (), "load": None}
    return ExpertReport(
        schema_version=1,
        player=player,
        split=split,
        **head,
        versions=simulation_versions(),
        worlds=world_versions(tasks, head.get("perturb", ""), head.get("setting", STANDARD)),
        violations=tuple(violations(player, split, bool(head.get("discretise")), outcomes)),
        loads=tuple(loads),
        # An episode in a few hundred bytes: a replay from its seed gives what is left out.
        episodes=tuple(
            each.model_copy(update=left_out | {"state_hash": each.state_hash[:STATE_HASH_DIGITS]})
            for each in outcomes
        ),
    )


def violations(
    player: PlayerName, split: str, is_discretised: bool, outcomes: Sequence[EpisodeOutcome]
) -> list[str]:
    """Criteria that a player does not meet, one sentence each.

    An expert must succeed in 99 % of the episodes of every variation, 97 % with rounded keyposes, arrive at every
    keypose, replay, and leave keyframes that are found again in 95 % of a task's episodes. With exact keyposes, of which
    datasets are made, its loads must stay within the limits of the real arm. (Half a voxel beside a handle that guides
    the hand, a stiff arm presses harder.) Holding still and random keyposes must never succeed, mean keyposes in at most
    10 % of a task's episodes. No episode may be unstable.
    """
    found = list[str]()
    solved = [outcome for outcome in outcomes if outcome.success]
    if player in EXPERTS:
        minimum = MIN_DISCRETISED_RATE if is_discretised else MIN_EXPERT_RATE
        for (task, variation), episodes in by_variation(outcomes).items():
            rate = success_rate(episodes)
            if rate.successes < minimum * rate.trials:
                too_rare = f"{rate.successes}/{rate.trials} is less than {minimum:.0%}"
                found.append(f"{task}, variation {variation}: {too_rare}")
        found += [f"{_place(split, one)}: {flaw}" for one in solved for flaw in _flaws(one, is_discretised)]
    for task in dict.fromkeys(outcome.task for outcome in outcomes):
        rate = success_rate([outcome for outcome in outcomes if outcome.task == task])
        if rate.successes > MAX_RATES.get(player, 1.0) * rate.trials:
            found.append(f"{task}: {player} succeeds in {rate.successes} of {rate.trials} episodes")
        right = [each.keyframes_found for each in solved if each.task == task]
        n_right, n = right.count(True), len(right) - right.count(None)
        if n_right < MIN_KEYFRAMES_FOUND * n:
            found.append(f"{task}: keyframe discovery is right in {n_right} of {n} episodes")
    unstable = (outcome for outcome in outcomes if outcome.unstable)
    return [*found, *(f"{_place(split, outcome)}: the simulation was unstable" for outcome in unstable)]


def _flaws(outcome: EpisodeOutcome, is_discretised: bool) -> Iterator[str]:
    """What is wrong with a solved episode of an expert."""
    for move in (outcome.moves[index] for index in outcome.late_moves):
        errors = f"{move.left_error_mm:.0f} and {move.right_error_mm:.0f}"
        yield f"at {move.name!r} the hands ended {errors} mm from their targets"
    if outcome.replayed is False:
        yield "its replay went through other states"
    if outcome.load is not None and not is_discretised:
        yield from (excess for _, excess in excesses(outcome.task, outcome.load))


def _place(split: str, outcome: EpisodeOutcome) -> str:
    return f"{outcome.task} {split} seed {outcome.seed} (variation {outcome.variation})"


def print_report(report: ExpertReport) -> None:
    """Print one line per variation, the failures of an expert, and the violations."""
    is_expert = report.player in EXPERTS
    table = pd.DataFrame(
        {
            "task": task,
            "variation": variation,
            "successes": "{0.successes}/{0.trials}".format(success_rate(episodes)),
            "95 % interval": "{:.1%} to {:.1%}".format(*success_rate(episodes).interval),
            "median time": f"{median_duration_s(episodes):.1f} s",
            "worst tip error": f"{worst_tip_error_mm(episodes):.1f} mm" if is_expert else "",
        }
        for (task, variation), episodes in report.by_variation.items()
    )
    title = f"{report.player} on {report.split} seeds {report.seeds.start} to {report.seeds.stop - 1}"
    if report.discretise:
        title += f", keyposes rounded to {report.discretise} voxels per axis"
    others = [name for name in (report.setting, report.perturb) if name not in ("", STANDARD)]
    print_table(table, ", ".join([title, *others]))
    console = Console(highlight=False, soft_wrap=True)
    for outcome in report.episodes:
        if is_expert and not outcome.success:
            unmet = ", ".join(outcome.unmet) or "none"
            place = f"{outcome.task} seed {outcome.seed} (variation {outcome.variation})"
            console.print(f"{place}: {outcome.failure}, at {outcome.last_move!r}; unmet: {unmet}")
    for violation in report.violations:
        console.print(f"violation: {violation}", style="red")
