"""The state of an episode besides that of its scene, and what its seed determines before the reset."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM
from lerobot_env_bimanual.conditions import Condition, check, history_conditions
from lerobot_env_bimanual.options import SETTINGS, SPLITS, STANDARD
from lerobot_env_bimanual.task import TaskSpec, Variation
from lerobot_env_bimanual.world.scene_view import SceneView

SUCCESS_TICKS = 10
"""Consecutive control ticks, half a second, that all conditions have to hold."""


@dataclass
class EpisodeProgress:
    """The running or finished episode.

    Attributes:
        seed: of the reset.
        variation: the drawn or chosen variation.
        instruction: the sentence that a policy is given.
        rng: the episode's only source of randomness.
        prop_set: index of its set of props among the task's sets for the setting.
        draws: placements that the reset drew until one could be rehearsed.
        conditions: each condition's name and whether it is met now; between the ticks of a step those after the first
            that is not met are left out.
        history_conditions: name of each condition on the way, `Once` or `Always`, and whether it is met so far.
        ticks: control ticks so far.
        keyposes: keyposes executed so far.
        held_ticks: consecutive ticks up to now at which all conditions were met.
        first_met_tick: number of ticks after which they were all met for the first time; None as long as they were not.
        sent_action: (16,) the last joint action that the arms were given; `change` is its difference from the one before, and
            `wanted` is the same action before it was limited.
        clipped_ticks: ticks whose joint action was faster than arms can follow, and was replaced by a slower one.
        clipped_rad: largest difference between such an action and its replacement, in any joint.
        filtered_forces_n: (2, 3) filtered net force on each arm, world frame; `overload_steps` (2,) counts the physics steps
            for which it has been too large. Both are only known with the option `protective_stop`.
        line_fallbacks: straight lines replaced by joint-space motions because an arm could not follow them.
        disturbances: how often an axis of perturbation has moved things.
        failure: what ended the episode, empty while nothing has.
        memory: what axes of perturbation remember of the episode, by their name; see `perturbations.axis.HookContext`.
    """

    seed: int
    variation: Variation
    instruction: str
    rng: np.random.Generator
    prop_set: int = 0
    draws: int = 0
    conditions: dict[str, bool] = field(default_factory=dict)
    history_conditions: dict[str, bool] = field(default_factory=dict)
    ticks: int = 0
    keyposes: int = 0
    held_ticks: int = 0
    first_met_tick: int | None = None
    sent_action: NDArray[np.float32] = field(default_factory=partial(np.zeros, JOINT_ACTION_DIM, np.float32))
    change: NDArray[np.float64] = field(default_factory=partial(np.zeros, JOINT_ACTION_DIM))
    wanted: NDArray[np.float32] = field(default_factory=partial(np.zeros, JOINT_ACTION_DIM, np.float32))
    clipped_ticks: int = 0
    clipped_rad: float = 0.0
    filtered_forces_n: NDArray[np.float64] = field(default_factory=partial(np.zeros, (len(ARMS), 3)))
    overload_steps: NDArray[np.int64] = field(default_factory=partial(np.zeros, len(ARMS), np.int64))
    line_fallbacks: int = 0
    disturbances: int = 0
    failure: str = ""
    memory: dict[str, object] = field(default_factory=dict)

    @property
    def succeeded(self) -> bool:
        """Whether the conditions held long enough."""
        return self.held_ticks >= SUCCESS_TICKS and not self.failure

    @property
    def terminated(self) -> bool:
        """Whether the verdict is known."""
        return self.succeeded or bool(self.failure)

    def record_action(self, wanted: NDArray[np.float32], sent_action: NDArray[np.float32]) -> None:
        """Remember a wanted joint action (16,), and the one that the arms are given in its place."""
        self.change = np.subtract(sent_action, self.sent_action, dtype=np.float64)
        self.sent_action, self.wanted = sent_action.copy(), wanted.copy()
        if sent_action is not wanted:
            self.clipped_ticks += 1
            self.clipped_rad = max(self.clipped_rad, float(np.abs(sent_action - wanted).max()))

    def judge(self, conditions: Iterable[Condition], scene: SceneView) -> None:
        """Evaluate the conditions after a tick: all `Once` and `Always` ones, the others up to the first unmet one."""
        self.history_conditions = history_conditions(conditions, scene, self.history_conditions)
        self.conditions = check(conditions, scene, self.history_conditions, until_unmet=True)
        self.held_ticks = self.held_ticks + 1 if all(self.conditions.values()) else 0
        if self.held_ticks and self.first_met_tick is None:
            self.first_met_tick = self.ticks

    def evaluate_all_conditions(self, conditions: Iterable[Condition], scene: SceneView) -> None:
        """Note of all conditions whether they are met now, at the end of a step."""
        self.conditions = check(conditions, scene, self.conditions | self.history_conditions)

    def joined_hash(self, scene_hash: str) -> str:
        """SHA-256, in hex, of a scene's hash, what the arms are told, and conditions on the way."""
        digest = hashlib.sha256(f"{scene_hash} {sorted(self.history_conditions.items())}".encode())
        for array in (
            self.sent_action,
            self.change,
            self.wanted,
            self.filtered_forces_n,
            self.overload_steps,
        ):
            digest.update(array.tobytes())
        return digest.hexdigest()

    def info(self) -> dict[str, Any]:
        """The `info` that the environment returns with its observation."""
        return {
            "is_success": self.succeeded,
            "conditions": dict(self.conditions),
            "failure": self.failure,
            "ticks": self.ticks,
            "line_fallbacks": self.line_fallbacks,
            "clipped_ticks": self.clipped_ticks,
            "clipped_rad": self.clipped_rad,
            "seed": self.seed,
            "instruction": self.instruction,
        }


def draw_episode(
    spec: TaskSpec, split: str, seed: int, fixed: int | None, setting: str = STANDARD
) -> EpisodeProgress:
    """An episode that has not begun: its variation, instruction, set of props and generator.

    Variation and sentence are always drawn, so that an episode is the same whether its variation was drawn or fixed. Props
    and layout are drawn from the variation, too, so that no two variations of a seed share a layout.

    The variation is the one with the index `fixed`; None leaves it to the seed.
    """
    entropy = [SPLITS[split], spec.id, seed, SETTINGS[setting]]
    rng = np.random.default_rng(np.random.SeedSequence(entropy))
    drawn, sentence = int(rng.integers(len(spec.variations))), int(rng.integers(len(spec.instructions)))
    variation = spec.variations[drawn if fixed is None else fixed]
    # A zero at the end of the entropy would change nothing; a key does.
    layout = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(variation.index,)))
    prop_set = int(layout.integers(len(spec.prop_sets(setting))))
    return EpisodeProgress(seed, variation, spec.instructions_for(variation)[sentence], layout, prop_set)
