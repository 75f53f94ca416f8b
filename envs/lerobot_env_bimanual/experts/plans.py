"""A demonstrator with several plans: no image shows which plan it follows, and both arms must follow the same one.

It demonstrates only where all plans of the task are feasible. Neither scene nor success depends on the plan. A dataset has the
same scenes for each plan, see `lerobot_env_bimanual.generation.plan`, so the scene gives no information about the plan.
"""

from collections.abc import Iterator

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import InvalidChoice, PlacementFailure
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.runner import Move, replanning
from lerobot_env_bimanual.stage import stages_and_targets
from lerobot_env_bimanual.worlds import CODECS


def infeasible_plan(env: BimanualEnv) -> str | None:
    """The first plan that the arms cannot do from the present state, and why; None if they can do all of them."""
    rehearsal, variation = Rehearsal(env.scene, CODECS), env.progress.variation
    for plan, name in enumerate(env.task_definition.spec.plans):
        if reason := rehearsal.infeasibility(env.task_definition.script_for_plan(variation, plan)):
            return f"plan {name!r}: {reason}"
    return None


def keyposes_by(env: BimanualEnv, plan: int) -> list[BimanualKeypose]:
    """The keyposes of a plan from the start on, as its script gives them while nothing moves."""
    script = env.task_definition.script_for_plan(env.progress.variation, plan)
    return [target for _, target in stages_and_targets(script, env.scene)]


def demonstrator(env: BimanualEnv, plan: int, codec: KeyposeCodec | None = None) -> Iterator[Move]:
    """Moves of the replanning expert by plan number `plan`, right after the reset; `codec` as in `expert`.

    Raises:
        InvalidChoice: the task has no such plan.
        PlacementFailure: not all plans can be done here.
    """
    if plan not in range(count := len(env.task_definition.spec.plans)):
        raise InvalidChoice("plan", plan, map(str, range(count)))
    if infeasible := infeasible_plan(env):
        raise PlacementFailure(infeasible)
    yield from replanning(codec, plan)(env)
