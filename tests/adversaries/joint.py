"""Adversaries that act by joint actions: each offers ways, of which the first that solves a copy of the episode is played."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from itertools import islice

from adversaries.hand import Moves, OutOfReach
from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.conditions import OnTheWay
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode

MAX_TRIES = 6
"""Ways that are tried in a copy of the episode."""

type Way = Callable[[BimanualEnv], Moves]
type Ways = Callable[[BimanualEnv, Arm], Iterable[Way]]


def ways_of(module: str) -> Ways:
    """The function `ways` of a module of this folder."""
    return importlib.import_module(f"{__package__}.{module}").ways


def joint_player(ways: Ways, arm: Arm) -> Player:
    """The best way that is known for the episode."""

    def play(env: BimanualEnv) -> Moves:
        tried = [(way, _rank(env, way)) for way in _until_solved(env, ways(env, arm))]
        best, _ = max(tried, key=lambda each: each[1])
        yield from _until_out_of_reach(best(env))

    return play


def tally(ways: Ways, task: str, arm: Arm, seeds: Iterable[int]) -> tuple[list[int], list[int]]:
    """The seeds that are solved, and those that would be if only the end counted, not what happened on the way."""
    env, solved, but_for_the_way = BimanualEnv(task, split="test", obs="state"), [], []
    for seed in seeds:
        outcome = run_episode(env, seed, joint_player(ways, arm))
        solved += [seed] * outcome.success
        but_for_the_way += [seed] * _only_the_way_is_unmet(env)
    env.close()
    return solved, but_for_the_way


def _until_solved(env: BimanualEnv, ways: Iterable[Way]) -> Iterator[Way]:
    for way in islice(ways, MAX_TRIES):
        yield way
        if _rank(env, way) == 2:
            return


def _rank(env: BimanualEnv, way: Way) -> int:
    """2 if a way solves a copy of the episode, 1 if all but conditions on the way are met at its end, else 0."""
    state = env.save_state()
    for move in _until_out_of_reach(way(env)):
        _, _, terminated, truncated, _ = env.step(move.action)
        if terminated or truncated:
            break
    rank = 2 if env.progress.succeeded else int(_only_the_way_is_unmet(env))
    env.restore_state(state)
    return rank


def _only_the_way_is_unmet(env: BimanualEnv) -> bool:
    conditions = env.task_definition.conditions(env.progress.variation)
    unmet = [each for each in conditions if not env.progress.conditions[each.name]]
    return all(isinstance(each, OnTheWay) for each in unmet)


def _until_out_of_reach(moves: Moves) -> Moves:
    try:
        yield from moves
    except OutOfReach:
        return
