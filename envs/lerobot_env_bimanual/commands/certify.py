"""The verb `certify`: how often the experts succeed, and how seldom their controls do."""

from __future__ import annotations

import json
import os
import platform
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.statistics import SuccessRate
from lerobot_env_bimanual.registry import get_task, resolve_tasks

if TYPE_CHECKING:
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.expert.runner import Outcome

BLIND_EPISODES = 30
"""Training episodes whose mean keyposes the blind control plays."""
PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "mujoco", "frankik", "numpy")
"""Packages whose versions decide the outcome of an episode."""

type Keyposes = tuple[tuple[float, ...], ...]


@dataclass
class CertifyConfig:
    """Options of the verb `certify`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, `any` (drawn per episode) or `each` (every variation on all seeds)
    seeds: str = "0:100"  # half-open range a:b
    split: Literal["train", "val", "test"] = "test"  # the same seeds mean other episodes in each
    control: Literal["expert", "noop", "random", "freeze_left", "freeze_right", "blind"] = (
        "expert"  # who plays
    )
    discretise: int = 0  # voxels per axis to which the expert's keyposes are rounded; 0 leaves them exact
    workers: int = 0  # processes; 0 takes one per core
    output: Path | None = None  # JSON file with versions, rates and every episode


@dataclass(frozen=True)
class Job:
    """One episode to be played by some process."""

    task: str
    variation: str
    split: str
    seed: int
    control: str
    discretise: int = 0
    blind_keyposes: Keyposes = ()


def certify(config: CertifyConfig) -> None:
    """Measure the success of an expert or a control over seeds.

    Prints the success rate of every variation with its 95 % Wilson interval, and each failure with its seed, last
    move and unmet conditions.

    Examples:
        lerobot-bimanual certify --task=lift_ball --seeds=0:300 --output=cert.json
        lerobot-bimanual certify --discretise=100
        lerobot-bimanual certify --control=blind --seeds=0:40
    """
    seeds = parse_seeds(config.seeds)
    workers = config.workers or os.cpu_count() or 1
    context = get_context("forkserver")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_use_one_thread) as pool:
        jobs = [job for name in resolve_tasks(config.task) for job in _jobs(pool, config, name, seeds)]
        outcomes = list(_play_all(pool, jobs, config.control))
    _print(outcomes, config.control)
    if config.output is not None:
        config.output.parent.mkdir(parents=True, exist_ok=True)
        config.output.write_text(json.dumps(certificate(config, outcomes), indent=1) + "\n")


def parse_seeds(text: str) -> range:
    """The half-open range `a:b` of seeds.

    Raises:
        BimanualError: the text is not such a range, or the range is empty.
    """
    first, _, end = text.partition(":")
    if not (first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise BimanualError(f"seeds is {text!r}, but must be a half-open range such as 0:100")
    return range(int(first), int(end))


def certificate(config: CertifyConfig, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """What is written to the output file."""
    return {
        "control": config.control,
        "discretise": config.discretise,
        "seeds": config.seeds,
        "split": config.split,
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "rates": [
            {"task": task, "variation": variation, **asdict(rate), "wilson_95": rate.interval}
            for (task, variation), rate in rates(outcomes).items()
        ],
        "episodes": [asdict(outcome) for outcome in outcomes],
    }


def rates(outcomes: Sequence[Outcome]) -> dict[tuple[str, int], SuccessRate]:
    """Success rate per task and variation, sorted."""
    successes: dict[tuple[str, int], list[bool]] = defaultdict(list)
    for outcome in outcomes:
        successes[outcome.task, outcome.variation].append(outcome.success)
    return {key: SuccessRate(sum(successes[key]), len(successes[key])) for key in sorted(successes)}


def _jobs(pool: ProcessPoolExecutor, config: CertifyConfig, task: str, seeds: Sequence[int]) -> Iterator[Job]:
    count = len(get_task(task).spec.variations)
    blind = config.control == "blind"
    # The blind control knows its variation, as a policy does from the instruction; so "any" is taken apart.
    separate = config.variation == "each" or (blind and config.variation == "any")
    for variation in map(str, range(count)) if separate else (config.variation,):
        keyposes = _mean_keyposes(pool, task, variation) if blind else ()
        for seed in seeds:
            yield Job(task, variation, config.split, seed, config.control, config.discretise, keyposes)


def _mean_keyposes(pool: ProcessPoolExecutor, task: str, variation: str) -> Keyposes:
    from lerobot_env_bimanual.expert.controls import mean_keyposes

    jobs = [Job(task, variation, "train", seed, "expert") for seed in range(BLIND_EPISODES)]
    episodes = [
        [move.keypose for move in outcome.keyposes]
        for outcome in _play_all(pool, jobs, "training episodes")
        if outcome.success
    ]
    if not episodes:
        raise BimanualError(f"the expert of {task!r} solved no training episode, so there is no mean to play")
    return tuple(map(tuple, mean_keyposes(episodes).tolist()))


def _play_all(pool: ProcessPoolExecutor, jobs: Sequence[Job], label: str) -> Iterator[Outcome]:
    from tqdm import tqdm

    yield from tqdm(pool.map(_play, jobs), total=len(jobs), desc=label, unit="episode", smoothing=0)


def _use_one_thread() -> None:
    """Keep linear algebra in a worker to its own core."""
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")


_environments: dict[tuple[str, str, str], BimanualEnv] = {}


def _play(job: Job) -> Outcome:
    from lerobot_bimanual.codec import KeyposeCodec
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.expert.controls import make_control
    from lerobot_env_bimanual.expert.runner import run_episode

    key = (job.task, job.variation, job.split)
    if key not in _environments:
        _environments.clear()
        _environments[key] = BimanualEnv(job.task, job.variation, job.split, obs="state")
    codec = KeyposeCodec(voxels=job.discretise) if job.discretise else None
    control = make_control(job.control, job.seed, codec, job.blind_keyposes)
    return run_episode(_environments[key], job.seed, control)


def _print(outcomes: Sequence[Outcome], control: str) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(
        "task", "variation", "successes", "95 % interval", "median time", title=f"control: {control}"
    )
    for (task, variation), rate in rates(outcomes).items():
        ticks = sorted(o.ticks for o in outcomes if (o.task, o.variation) == (task, variation))
        low, high = rate.interval
        seconds = ticks[len(ticks) // 2] / 20
        table.add_row(
            task,
            str(variation),
            f"{rate.successes}/{rate.trials}",
            f"{low:.1%} to {high:.1%}",
            f"{seconds:.1f} s",
        )
    console.print(table)
    if control == "expert":
        for outcome in outcomes:
            if not outcome.success:
                unmet = ", ".join(outcome.unmet)
                console.print(
                    f"{outcome.task} seed {outcome.seed} variation {outcome.variation}: {outcome.failure}, "
                    f"at {outcome.last_move!r}; unmet: {unmet}",
                    highlight=False,
                )
