"""A robustness result of two axes along one of which success drops, and a report of the expert."""

from typing import Any

from sample_results import episodes

from lerobot_bimanual.distributions import SIMULATION_PACKAGES
from lerobot_bimanual.results.robustness import (
    AxisRecord,
    ExpertCondition,
    ExpertRobustnessConfig,
    ExpertRobustnessReport,
    PolicyCondition,
    RobustnessConfig,
    RobustnessResult,
)


def condition(axis: str, level: int, outcomes: str, expert: str = "", open_loop: str = "", **more: Any):
    """One episode per letter, `x` solved; without letters the expert solves all, the open-loop baseline none."""
    return PolicyCondition(
        axis=axis,
        level=level,
        world=world(axis, level),
        expert_solved=solved(expert or "x" * len(outcomes)),
        open_loop_solved=solved(open_loop),
        episodes=episodes(outcomes, 0, "out of time", variation=0, keyposes=5, ticks=120),
        **more,
    )


def world(axis: str, level: int) -> str:
    return f"{axis.encode().hex()[:8]:0<8}{level:04}"


def solved(outcomes: str) -> tuple[int, ...]:
    return tuple(seed for seed, letter in enumerate(outcomes) if letter == "x")


AXES = (
    AxisRecord(name="camera_moved", group="seen", unit="degrees", magnitudes=(2.0, 5.0, 10.0)),
    AxisRecord(name="mass", group="bodies", unit="times the mass", magnitudes=(1.2, 1.5, 2.0)),
)
ROBUSTNESS = RobustnessResult(
    schema_version=3,
    config=RobustnessConfig(
        task="lift_ball",
        policy="mine",
        checkpoint_sha256="0f" * 32,
        options={"split": "test", "variation": "any"},
        policy_flags=("--use_amp=false",),
        episodes=10,
        batch_size=2,
        versions=dict.fromkeys(SIMULATION_PACKAGES, "3"),
    ),
    checkpoint="outputs/mine",
    date="2026-01-31",
    axes=AXES,
    not_applicable=("stiffness",),
    conditions=(
        condition("", 0, "xxxxxxxxxx", open_loop="x........."),
        condition("camera_moved", 1, "xxxxxxxxx."),
        condition("camera_moved", 2, "xxxx......"),
        condition("camera_moved", 3, ".........."),
        condition("mass", 1, "xxxxxxxxxx"),
        condition("mass", 2, "xxxxxxxx.."),
        condition("mass", 3, "xx........", expert="xxxx......"),
    ),
)
EXPERT_REPORT = ExpertRobustnessReport(
    schema_version=3,
    config=ExpertRobustnessConfig(
        task="lift_ball",
        split="test",
        first_seed=100,
        expert_episodes=100,
        open_loop_episodes=30,
        versions={"mujoco": "3"},
    ),
    axes=AXES[1:],
    not_applicable=("stiffness",),
    conditions=(
        ExpertCondition(world=world("", 0)),
        ExpertCondition(
            axis="mass",
            level=1,
            world=world("mass", 1),
            expert_failed=(103, 150, 199),
            open_loop_solved=(101,),
        ),
        ExpertCondition(axis="mass", level=3, world=world("mass", 3), expert_failed=(100, 101, 102, 103)),
    ),
)
