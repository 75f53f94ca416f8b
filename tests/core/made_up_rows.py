"""A made-up row of results, and others like it."""

from dataclasses import replace
from pathlib import Path

from lerobot_bimanual.benchmark.episode_result import EpisodeResult, Validation
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.benchmark.training_record import DatasetRecord, Machine
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.results.action_text import actions_to_text
from lerobot_bimanual.versions import SIMULATION_PACKAGES


def episodes(outcomes: str, first_seed: int = 0) -> tuple[EpisodeResult, ...]:
    """One episode per letter, `x` solved and `.` not."""
    return tuple(EpisodeResult(first_seed + index, letter == "x") for index, letter in enumerate(outcomes))


def recorded(outcomes: str, first_seed: int = 0) -> tuple[PlayedEpisode, ...]:
    """The same of a policy that was tested, with actions that nobody has played."""
    return tuple(
        PlayedEpisode(
            seed=first_seed + index,
            variation=0,
            instruction="lift the ball",
            success=letter == "x",
            first_met_tick=3 if letter == "x" else None,
            failure="" if letter == "x" else "out of time",
            ticks=12,
            keyposes=1,
            start="0a" * 32,
            actions=(actions_to_text([[0.5] * 18]),),
            links="00000",
            end="0b" * 32,
        )
        for index, letter in enumerate(outcomes)
    )


def played(outcomes: str, variation: int = 0) -> tuple[EpisodeResult, ...]:
    """The same of an expert or control, of which more is known."""
    return tuple(
        EpisodeResult(seed, letter == "x", variation, None if letter == "x" else "fell", f"{seed:016x}")
        for seed, letter in enumerate(outcomes)
    )


def generation(task: str) -> str:
    return f"lerobot-bimanual dataset generate --task={task} --variation=any --episodes=2 --split=train --image_size=128x128"


VERSIONS = dict.fromkeys(SIMULATION_PACKAGES, "3")
ROW = ResultRow(
    schema_version=3,
    world="0123456789ab",
    task="lift_ball",
    variation="any",
    policy="mine",
    recipe="small",
    flags={
        "dataset.repo_id": "benchmark/lift_ball",
        "policy.type": "mine",
        "policy.depth": "3",
        "policy.shift": "[0.5, 0]",
        "policy.head": "null",
        "policy.name": "plain",
        "steps": "4",
        "batch_size": "2",
        "save_freq": "2",
        "log_freq": "1",
        "seed": "1000",
    },
    dataset=DatasetRecord(generation("lift_ball"), 128, (0, 1), VERSIONS),
    checkpoint_step=4,
    checkpoint_sha256="0f" * 32,
    validation=(Validation(2, episodes("..")), Validation(4, episodes(".x"))),
    split="test",
    options={"split": "test"},
    batch_size=2,
    episodes=recorded("xx.."),
    stopped_against=None,
    expert=played("xxxx"),
    blind=played("x..."),
    training_seconds=1.5,
    machine=Machine(2, None),
    versions=VERSIONS | {"torch": "2"},
    date="2026-01-31",
)


def row_of(policy: str, task: str, **changes) -> ResultRow:
    flags = ROW.flags | {"dataset.repo_id": f"benchmark/{task}", "policy.type": policy}
    dataset = replace(ROW.dataset, command=generation(task))
    return replace(ROW, **{"policy": policy, "task": task, "flags": flags, "dataset": dataset} | changes)


def put(folder: Path, row: ResultRow) -> Path:
    path = folder / row.file_name
    path.write_text(row.to_json())
    return path
