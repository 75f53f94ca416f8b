"""Single-arm adversaries: what one arm alone may do, and how it chooses among the strategies of a task.

A strategy is a script like an expert's, but for one arm; the other one stays at home, its hand open. A module per task
offers strategies, best first. An adversary is given more than any policy has: it sees the state, rehearses strategies
without physics, tries a few of those that can be rehearsed in a copy of the episode, and plays the first that succeeds.
"""

import importlib
from collections.abc import Callable, Iterator
from itertools import islice

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.baselines import play_script
from lerobot_env_bimanual.experts.runner import Move, Player
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.world.scene_view import SceneView

TASKS = ("pick_laptop", "put_item_in_drawer", "take_tray_out_of_oven")
"""Tasks that have a module here."""
MAX_TRIES = 3
"""Strategies that are tried in a copy of the episode."""

type Strategy = Callable[[SceneView], Iterator[Stage]]
type Strategies = Callable[[SceneView, Variation, Arm], Iterator[Strategy]]


def strategies_of(task: str) -> Strategies:
    """The function `strategies` of the module that bears the task's name."""
    return importlib.import_module(f"{__package__}.{task}").strategies


def alone(
    arm: Arm,
    name: str,
    pose: Pose | None = None,
    is_open: bool | None = None,
    planned: bool = False,
    holds: str | None = None,
) -> Stage:
    """A stage of one arm; the arguments are those of `Stage`."""
    own = {arm.value: pose, f"{arm.value}_open": is_open, f"{arm.value}_holds": holds}
    return Stage(name, planned=planned, **own)


def single_arm(arm: Arm) -> Player:
    """One arm alone, with the best strategy that is known for the episode."""

    def play(env: BimanualEnv) -> Iterator[Move]:
        yield from play_script(env, _best_strategy(env, arm))

    return play


def _best_strategy(env: BimanualEnv, arm: Arm) -> Strategy:
    """The first strategy that succeeds in a copy of the episode, of those that can be rehearsed; else the first."""
    rehearsal = Rehearsal(env.scene)
    every = list(strategies_of(env.task)(env.scene, env.progress.variation, arm))
    feasible = list(islice((each for each in every if rehearsal.infeasibility(each) is None), MAX_TRIES))
    if len(feasible) < 2:
        return (feasible or every)[0]
    return next((each for each in feasible if _succeeds(env, each)), feasible[0])


def _succeeds(env: BimanualEnv, strategy: Strategy) -> bool:
    """Whether a strategy solves the episode from its present state, which is restored afterwards."""
    state = env.save_state()
    for move in play_script(env, strategy):
        _, _, terminated, truncated, _ = env.step(move.action)
        if terminated or truncated:
            break
    succeeded = env.progress.succeeded
    env.restore_state(state)
    return succeeded
