"""Agreement of the arms in tasks with several plans: which plan each arm's first choice follows.

The first choice of an arm is its keypose at the first index at which the plans send it to different places. It follows the plan
whose place is nearest. Scenes that do not allow all plans leave nothing to choose.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.plans import infeasible_plan, keyposes_by
from lerobot_env_bimanual.verification.episodes import recorded_actions, replay_env

MIN_APART_M = 0.03
"""Nearer places of two plans are one place."""


class FirstChoices:
    """Tells the first choices in episodes of an evaluation with these options."""

    def __init__(self, task: str, options: Mapping[str, str | int]):
        self._env = replay_env(task, options)

    def __call__(self, episode: Episode) -> dict[str, Any] | None:
        """`seed`, `success`, and `left_plan` and `right_plan`, the numbers of the plans that the arms follow.

        None where the scene does not allow all plans, or an arm did not come to choose.
        """
        self._env.reset(seed=episode.seed, options={"variation": episode.variation})
        left, right = plans_of_arms(self._env, recorded_actions(episode))
        if left is None or right is None or infeasible_plan(self._env):
            return None
        return {"seed": episode.seed, "success": episode.success, "left_plan": left, "right_plan": right}


def common_plan(env: BimanualEnv, episode: Episode) -> int:
    """Number of the plan that both arms follow at first, right after the reset; 0 if they differ or not all can be done."""
    left, right = plans_of_arms(env, recorded_actions(episode))
    return left if left and left == right and not infeasible_plan(env) else 0


def plans_of_arms(env: BimanualEnv, actions: Iterable[NDArray[np.float32]]) -> list[int | None]:
    """Numbers of the plans that left and right arm follow at first, by the keyposes among actions; None without a choice."""
    chosen_keyposes = [each for each in actions if each.size == KEYPOSE_DIM and np.isfinite(each).all()]
    plans = [keyposes_by(env, plan) for plan in range(len(env.task_definition.spec.plans))]
    followed: list[int | None] = [None, None]
    for action, *keyposes in zip(chosen_keyposes, *plans, strict=False):
        for arm, chosen in zip(ARMS, action.reshape(len(ARMS), ARM_KEYPOSE_DIM), strict=True):
            places_m = np.array([keypose[arm].pose.position for keypose in keyposes])
            if followed[arm.ordinal] is None and np.ptp(places_m, axis=0).max() > MIN_APART_M:
                followed[arm.ordinal] = int(np.linalg.norm(places_m - chosen[:3], axis=1).argmin())
    return followed
