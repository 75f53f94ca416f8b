"""Protocols: what a policy learns from and what it is tested on. Each is a column of the board.

They are frozen: a result names its protocol, and is refused if that protocol has other flags here. How a policy is trained
belongs to its recipe, not to the protocol.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

TASKS = (
    "dual_push_buttons",
    "handover_item",
    "handover_item_easy",
    "lift_ball",
    "lift_tray",
    "pick_laptop",
    "pick_plate",
    "push_box",
    "put_bottle_in_fridge",
    "put_item_in_drawer",
    "straighten_rope",
    "sweep_to_dustpan",
    "take_tray_out_of_oven",
)
"""The tasks of the PerAct2 paper, frozen like the protocols: not those that happen to be installed."""


@dataclass(frozen=True)
class Flags:
    """What a protocol fixes: flags of `policy benchmark`, as `BenchmarkSettings` has them."""

    demos: int = 100
    demos_plans: str = "one"
    demos_variation: str = ""
    demos_perturb: str = ""
    trained_on: str = ""
    setting: str = "standard"
    variation: str = "any"
    perturb: str = ""
    first_seed: int = 4_000_000


@dataclass(frozen=True)
class Protocol(Flags):
    """One protocol.

    Attributes:
        tasks: tasks of the protocol; empty for any.
        perturb_of: task -> its own `perturb`, where an axis of the common one finds nothing to change in the task.
        rounds: factor by which the recipe's steps, and those between its checkpoints, are multiplied.
    """

    tasks: tuple[str, ...] = TASKS
    perturb_of: Mapping[str, str] = MappingProxyType({})
    rounds: int = 1

    def flags(self, task: str) -> dict[str, Any]:
        """The flags of a task by name."""
        own = {"perturb": self.perturb_of[task]} if task in self.perturb_of else {}
        return {field.name: getattr(self, field.name) for field in fields(Flags)} | own


RULES = ("max_keyposes", "protective_stop")
"""Options of the environment that decide what happens in an episode; a protocol leaves them at their defaults."""
OWN = "own"
"""The protocol of a benchmark whose flags match no other protocol."""
PROTOCOLS = {
    OWN: Protocol(first_seed=0, tasks=()),  # the defaults of the flags
    "standard": Protocol(),
    "few": Protocol(demos=20),
    "plans": Protocol(
        demos_plans="several",
        tasks=(
            *("dual_push_buttons", "lift_ball", "lift_tray"),
            *("pick_plate", "push_box", "straighten_rope"),
        ),
    ),
    "varied": Protocol(setting="varied"),
    "hard": Protocol(
        perturb="camera_moved:2,clutter:2,light:2,nudge:1,start_posture:2",
        perturb_of={"dual_push_buttons": "camera_moved:2,clutter:2,light:2,start_posture:2"},
    ),
    # The words for purple and orange are learned beside green, and tested together. No other task names two things.
    "pairings": Protocol(demos_variation="0,1,2,3", variation="4", tasks=("dual_push_buttons",)),
    "multitask": Protocol(trained_on="all", rounds=12),
}


def protocol_of(settings: Mapping[str, Any]) -> str:
    """Name of the protocol that has the flags of some settings; `own` if none has."""
    task = settings["task"]
    if any(f"env.{name}" in settings["evaluation"] for name in RULES):
        return OWN
    named = (
        name
        for name, protocol in PROTOCOLS.items()
        if name != OWN
        and task in (protocol.tasks or (task,))
        and protocol.flags(task).items() <= settings.items()
    )
    return next(named, OWN)
