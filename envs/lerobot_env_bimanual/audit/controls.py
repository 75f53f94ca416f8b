"""What stands beside a policy in its row, played anew: demonstrations it learned from, expert and blind."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from tqdm import tqdm

from lerobot_bimanual.errors import PlacementFailure
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.expert_report import PlayerName
from lerobot_env_bimanual.audit.episodes import placement_hash
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.report import STATE_HASH_DIGITS
from lerobot_env_bimanual.options import ANY_VARIATION
from lerobot_env_bimanual.sweep.evaluator import Evaluator
from lerobot_env_bimanual.sweep.spec import EpisodeSpec
from lerobot_env_bimanual.tasks.registry import get_task


def demonstrated_placements(row: BenchmarkResult) -> dict[str, int]:
    """Hash of where everything stood at the start of each demonstration, and its seed."""
    demonstrations = row.demonstrations
    first_seed = int(str(demonstrations.settings.get("first_seed", 0)))
    return _placements(
        row.task, row.config.variation, first_seed, row.config.demos_perturb, demonstrations.seeds
    )


@functools.cache
def _placements(
    task: str, variation: str, first: int, perturb: str, seeds: tuple[int, ...]
) -> dict[str, int]:
    """The same for all rows whose policies learned from the same demonstrations."""
    spec = get_task(task).spec
    # Of several variations seeds take turns, as `generate` has it.
    indices = range(len(spec.variations)) if variation == ANY_VARIATION else [int(variation)]
    env = BimanualEnv(task, split="train", obs="state", perturb=perturb)
    found: dict[str, int] = {}
    for seed in tqdm(seeds, f"{task}: starts of demonstrations", unit="reset"):
        try:
            env.reset(seed=seed, options={"variation": indices[(seed - first) % len(indices)]})
        except PlacementFailure:
            continue  # and so it was no demonstration
        found[placement_hash(env)] = seed
    env.close()
    return found


def control_problems(row: BenchmarkResult, campaign: Evaluator, seeds: Iterable[int]) -> Iterator[str]:
    """What a row says of expert and blind that is not so.

    Args:
        row: whose controls are played.
        campaign: plays them.
        seeds: of the sample.
    """
    seeds = list(seeds)
    claims: dict[PlayerName, list[Episode]] = {
        "expert": [episode for episode in row.expert if episode.seed in seeds],
        "open_loop": [episode for episode in row.open_loop if episode.seed in seeds],
    }
    for control, episodes in claims.items():
        yield from _control_problems(campaign, row.task, control, episodes, row.evaluation.perturb)


def _control_problems(
    campaign: Evaluator, task: str, control: PlayerName, episodes: list[Episode], perturb: str = ""
) -> Iterator[str]:
    by_variation: Mapping[str, list[Episode]] = {}
    for episode in episodes:
        by_variation.setdefault(str(episode.variation), []).append(episode)
    for variation, claimed in by_variation.items():
        keyposes = campaign.mean_keyposes(task, variation) if control == "open_loop" else ()
        job = EpisodeSpec(task, variation, "test", 0, control, mean_keyposes=keyposes, perturb=perturb)
        outcomes = campaign.play(
            [replace(job, seed=episode.seed) for episode in claimed], f"{task}: {control}"
        )
        for episode, outcome in zip(claimed, outcomes, strict=True):
            who = f"{control}, variation {variation}, seed {episode.seed}"
            if episode.success != outcome.success:
                yield f"{who}: success is {episode.success}, but {outcome.success} when it is played again"
            elif (episode.state_hash or "")[:STATE_HASH_DIGITS] != (outcome.state_hash or "")[
                :STATE_HASH_DIGITS
            ]:
                yield f"{who}: another state at the end"
