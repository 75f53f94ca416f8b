"""Sample results of a benchmark, outcomes of an expert, and a sample provenance of a dataset."""

from pathlib import Path
from typing import Any

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import EpisodeKey, Provenance, SkippedSeed
from lerobot_bimanual.distributions import SIMULATION_PACKAGES
from lerobot_bimanual.results.benchmark import (
    BenchmarkResult,
    BenchmarkSettings,
    Demonstrations,
    Machine,
    Validation,
)
from lerobot_bimanual.results.episode import Episode, LoadMetrics, Proof
from lerobot_bimanual.results.expert_report import EpisodeOutcome, ExpertReport, MoveReport, VariationLoad
from lerobot_bimanual.results.proof import actions_to_text

VERSIONS: dict[str, str] = dict.fromkeys(SIMULATION_PACKAGES, "3")
WORLD = "0123456789ab"


def episodes(outcomes: str, first_seed=0, failure: str | None = None, **fields: Any) -> tuple[Episode, ...]:
    """One episode per letter, `x` solved and `.` not; all with the same further fields."""
    return tuple(
        Episode(seed=seed, success=letter == "x", failure=None if letter == "x" else failure, **fields)
        for seed, letter in enumerate(outcomes, first_seed)
    )


def proved(outcomes: str, first_seed: int = 0) -> tuple[Episode, ...]:
    """Episodes like those of `episodes`, each with a proof in the form of a recorded one."""
    hashes = {"start": "0a" * 32, "links": "00000", "end": "0b" * 32}
    proof = Proof(instruction="lift the ball", actions=(actions_to_text([[0.5] * 18]),), **hashes)
    return episodes(outcomes, first_seed, "out of time", variation=0, ticks=12, keyposes=1, proof=proof)


def reported(outcomes: str, variation: int = 0, first_seed: int = 0) -> tuple[Episode, ...]:
    """Episodes like those of `episodes`, in the form in which a result reports the expert and baselines."""
    return episodes(outcomes, first_seed, "fell", variation=variation, state_hash="0" * 16)


LIGHT = LoadMetrics(
    **dict.fromkeys(("torque", "velocity", "acceleration", "jerk", "penetration_mm"), 0.5),
    **{"saturated": 0.0, "contact_force_n": 5.0, "finger_speed_m_s": 0.05, "penetrating": "hand, box"},
)


def outcome(success: bool = True, seed: int = 0, **changes: Any) -> EpisodeOutcome:
    fields: dict[str, Any] = {
        **{"task": "lift_ball", "variation": 0, "seed": seed, "success": success, "ticks": 20},
        **{"state_hash": f"{seed:064x}", "last_move": "lift"},
        "moves": (MoveReport("beside", 20, 1.0, 2.0),),
        "commands": ((0.5,) * 18,),
    }
    if success:
        fields |= {"load": LIGHT, "keyframes_found": True, "replayed": True}
    else:
        fields |= {"failure": "no move left", "unmet": ("above(ball)",)}
    return EpisodeOutcome(**fields | changes)


def outcomes(solved: int, failed: int, **changes: Any) -> list[EpisodeOutcome]:
    successes = [True] * solved + [False] * failed
    return [outcome(success, seed, **changes) for seed, success in enumerate(successes)]


EXPERT = ExpertReport.of(
    **{"schema_version": 1, "player": "expert", "split": "test", "first_seed": 0, "n_seeds": 2},
    versions=VERSIONS,
    worlds={"lift_ball": WORLD},
    violations=("too slow",),
    loads=(VariationLoad(task="lift_ball", variation=0, load=LIGHT),),
    episodes=(outcome(load=None), outcome(False, seed=1)),
)


def provenance(view: schema.View = "frames", **fields: Any) -> Provenance:
    """Of a dataset of two episodes, of three seeds that were tried."""
    key = {"task": "lift_ball", "variation": 0, "split": "train"}
    usual = {
        "schema_version": schema.SCHEMA_VERSION,
        "versions": {"mujoco": "3"},
        "worlds": {"lift_ball": WORLD},
        "settings": {"episodes": 2, "intermediate": [0.5]},
        "command": "lerobot-bimanual dataset generate --task=lift_ball",
        "episodes": (EpisodeKey(seed=0, **key), EpisodeKey(seed=2, **key)),
        "skipped": (SkippedSeed(seed=1, reason="left arm: unreachable", **key),),
    }
    return Provenance.of(view=view, **usual | fields)


RESULT = BenchmarkResult(
    schema_version=4,
    config=BenchmarkSettings(
        policy="mine",
        task="lift_ball",
        recipe="small",
        demos=2,
        image_size=128,
        steps=4,
        batch_size=2,
        save_freq=2,
        val_episodes=2,
        test_episodes=4,
        seed=1000,
        training={
            "policy.depth": 3,
            "policy.shift": [0.5, 0],
            "policy.head": None,
            "policy.name": "plain",
            "num_workers": 0,
            "log_freq": 1,
        },
    ),
    world=WORLD,
    demonstrations=Demonstrations(settings={"first_seed": 0, "depth": True}, seeds=(0, 1), versions=VERSIONS),
    checkpoint_step=4,
    checkpoint_sha256="0f" * 32,
    training_seconds=1.5,
    machine=Machine(cpus=2),
    options={"variation": "any", "split": "test", "setting": "standard", "perturb": ""},
    batch_size=2,
    versions=VERSIONS | {"torch": "2"},
    date="2026-01-31",
    validation=(Validation(step=2, episodes=episodes("..")), Validation(step=4, episodes=episodes(".x"))),
    episodes=proved("xx.."),
    expert=reported("xxxx"),
    open_loop=reported("x..."),
)


def variant(result=RESULT, config: dict[str, Any] | None = None, **fields) -> BenchmarkResult:
    """A result with other fields, and with other settings in its config."""
    settings = BenchmarkSettings.of(**dict(result.config) | (config or {}))
    played = {name: getattr(settings, name) for name in ("variation", "setting", "perturb")}
    return BenchmarkResult.of(
        **dict(result) | {"config": settings, "options": dict(result.options) | played} | fields
    )


def trained(
    outcomes: str, seed: int = 1, policy: str = "mine", task: str = "lift_ball", first_seed: int = 0, **fields
) -> BenchmarkResult:
    """A result of a training with this seed: one test episode per letter, one checkpoint, no validation."""
    count = len(outcomes)
    config = {"policy": policy, "task": task, "seed": seed, "first_seed": first_seed, "test_episodes": count}
    config |= {"save_freq": 4, "val_episodes": 0} | fields.pop("config", {})
    usual = {
        "episodes": proved(outcomes, first_seed),
        "expert": reported("x" * count, first_seed=first_seed),
        "open_loop": reported("x" + "." * (count - 1), first_seed=first_seed),
        "checkpoint_sha256": f"{seed:064x}",
        "validation": (),
    }
    return variant(config=config, **usual | fields)


def put(folder: Path, result: BenchmarkResult) -> Path:
    """Write a result under its name."""
    path = folder / result.config.file_name
    result.write(path)
    return path
