"""Ways of one arm: modules of this folder offer them, and the first that solves a copy of the episode is played.

An adversary is given more than any policy has: it sees the state, and tries several ways before it acts. Most act by joint
actions; a script of keyposes that one arm follows can be rehearsed without physics first.
"""

import importlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from itertools import chain, islice, product

from adversaries.hand import Moves, OutOfReach
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.conditions import OnTheWay
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.baselines import play_script
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Script

MAX_TRIES = 14
"""Ways that are tried in a copy of the episode."""
SOLVED_BY_ONE_ARM = (
    ("pick_laptop", "left"),
    ("put_item_in_drawer", "right"),
    ("take_tray_out_of_oven", "left"),
)
"""Tasks that one arm can do, and one that does."""
UNSOLVED_BY_ONE_ARM = (
    ("put_bottle_in_fridge", "left"),
    ("pick_plate", "right"),
    ("sweep_to_dustpan", "left"),
    ("sweep_to_dustpan", "right"),
    ("push_box", "right"),
    ("handover_item_easy", "left"),
    ("handover_item", "left"),
    ("dual_push_buttons", "right"),
    ("lift_ball", "left"),
    ("straighten_rope", "left"),
)
"""The others, and the arm that gets furthest; joint targets found by search get further (docs/environment.md)."""

type Way = Callable[[BimanualEnv], Moves]


def ways(env: BimanualEnv, arm: Arm) -> Iterable[Way]:
    """The ways that the task's module offers; both handovers have one."""
    module = "handover" if env.task.startswith("handover") else env.task
    return importlib.import_module(f"{__package__}.{module}").ways(env, arm)


def parameter_grid(function: Callable, **choices: Iterable) -> Iterator[partial]:
    """The function with every combination of the given arguments; the last argument changes first."""
    return (partial(function, **dict(zip(choices, each, strict=True))) for each in product(*choices.values()))


def alone(arm: Arm, name: str, pose: Pose, is_open: bool | None = None, **others: bool | str) -> Stage:
    """A stage of one arm; the other one stays where it is, its hand open.

    Args:
        arm: whose stage.
        name: of the stage.
        pose: where its hand goes.
        is_open: state of its gripper afterwards; None keeps it.
        others: `holds`, the prop that its hand then holds, and `planned`, as of `Stage`.
    """
    own = {arm.value: pose, f"{arm.value}_open": is_open, f"{arm.value}_holds": others.pop("holds", None)}
    return Stage(name, **own, **others)


def rehearsed(env: BimanualEnv, scripts: Iterable[Script]) -> Iterator[Way]:
    """The scripts whose rehearsal succeeds; then the first script, whether it succeeds or not."""
    rehearsal, every = Rehearsal(env.scene), [*scripts]
    feasible = (script for script in every if rehearsal.infeasibility(script) is None)
    return (partial(play_script, script=script) for script in chain(feasible, every[:1]))


def one_armed(arm: Arm) -> Player:
    """The best way that is known for the episode."""

    def play(env: BimanualEnv) -> Moves:
        ranks: dict[Way, int] = {}
        for way in islice(ways(env, arm), MAX_TRIES):
            ranks[way] = _rank(env, way)
            if ranks[way] == 2:
                break
        with suppress(OutOfReach):
            yield from max(ranks, key=lambda way: ranks[way])(env)

    return play


def tally(task: str, arm: Arm, seeds: Iterable[int]) -> tuple[list[int], list[int]]:
    """The seeds that are solved, and those that would be if only the end counted, not what happened on the way."""
    env, solved, solved_by_end_state = BimanualEnv(task, split="test", obs="state"), [], []
    for seed in seeds:
        outcome = run_episode(env, seed, one_armed(arm))
        solved += [seed] * outcome.success
        solved_by_end_state += [seed] * _has_met_end_conditions(env)
    env.close()
    return solved, solved_by_end_state


def _rank(env: BimanualEnv, way: Way) -> int:
    """2 if a way solves a copy of the episode, 1 if all but conditions on the way are met at its end, else 0."""
    state = env.save_state()
    with suppress(OutOfReach):
        for move in way(env):
            _, _, terminated, truncated, _ = env.step(move.action)
            if terminated or truncated:
                break
    rank = 2 if env.progress.succeeded else int(_has_met_end_conditions(env))
    env.restore_state(state)
    return rank


def _has_met_end_conditions(env: BimanualEnv) -> bool:
    conditions = env.task_definition.conditions(env.progress.variation)
    unmet = [each for each in conditions if not env.progress.conditions[each.name]]
    return all(isinstance(each, OnTheWay) for each in unmet)
