"""The verb `certify`: how often the experts succeed, and how seldom their controls do."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, Literal

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.errors import BimanualError

if TYPE_CHECKING:
    from lerobot_env_bimanual.expert.campaign import Campaign, Job
    from lerobot_env_bimanual.expert.runner import Outcome

EACH_VARIATION = "each"
PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "mujoco", "frankik", "numpy")
"""Packages whose versions decide the outcome of an episode."""


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


def certify(config: CertifyConfig) -> None:
    """Measure the success of an expert or a control over seeds.

    Prints the success rate of every variation with its 95 % Wilson interval, and each failure of an expert with its
    seed, last move and unmet conditions. The blind control plays the mean keyposes of 30 training episodes of the
    variation, whatever the scene.

    Examples:
        lerobot-bimanual certify --task=lift_ball --seeds=0:300 --output=certificate.json
        lerobot-bimanual certify --discretise=100
        lerobot-bimanual certify --control=blind --seeds=0:40
    """
    from lerobot_env_bimanual.expert.campaign import Campaign
    from lerobot_env_bimanual.registry import resolve_tasks

    names, seeds = resolve_tasks(config.task), parse_seeds(config.seeds)
    for name in names:
        _check_variation(name, config.variation)
    with Campaign(config.workers) as campaign:
        jobs = [job for name in names for job in _jobs(campaign, config, name, seeds)]
        outcomes = campaign.play(jobs, config.control)
    _print(outcomes, config)
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


def _check_variation(task: str, variation: str) -> None:
    """Refuse, before any process starts, a variation that the task does not have."""
    from lerobot_env_bimanual.env import BimanualEnv

    if variation != EACH_VARIATION:
        BimanualEnv(task, variation)


def certificate(config: CertifyConfig, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """What is written to the output file."""
    from lerobot_env_bimanual.expert.campaign import rates

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


def _jobs(campaign: Campaign, config: CertifyConfig, task: str, seeds: Sequence[int]) -> Iterator[Job]:
    from lerobot_env_bimanual.expert.campaign import Job
    from lerobot_env_bimanual.registry import get_task
    from lerobot_env_bimanual.settings import ANY_VARIATION

    blind = config.control == "blind"
    # The blind control may know its variation, as a policy does from the instruction: "any" is taken apart.
    apart = config.variation == EACH_VARIATION or (blind and config.variation == ANY_VARIATION)
    indices = map(str, range(len(get_task(task).spec.variations)))
    for variation in indices if apart else (config.variation,):
        keyposes = campaign.blind_keyposes(task, variation) if blind else ()
        for seed in seeds:
            yield Job(task, variation, config.split, seed, config.control, config.discretise, keyposes)


def _print(outcomes: Sequence[Outcome], config: CertifyConfig) -> None:
    from rich.console import Console
    from rich.table import Table

    from lerobot_env_bimanual.expert.campaign import rates

    console = Console()
    rounding = f", keyposes rounded to {config.discretise} voxels per axis" if config.discretise else ""
    table = Table(title=f"{config.control} on {config.split} seeds {config.seeds}{rounding}")
    for heading in ("task", "variation", "successes", "95 % interval", "median time"):
        table.add_column(heading, justify="left" if heading == "task" else "right")
    for (task, variation), rate in rates(outcomes).items():
        ticks = median(o.ticks for o in outcomes if (o.task, o.variation) == (task, variation))
        low, high = rate.interval
        successes, interval = f"{rate.successes}/{rate.trials}", f"{low:.1%} to {high:.1%}"
        table.add_row(task, str(variation), successes, interval, f"{ticks / CONTROL_HZ:.1f} s")
    console.print(table)
    for outcome in outcomes:
        if config.control == "expert" and not outcome.success:
            console.print(
                f"{outcome.task} seed {outcome.seed} (variation {outcome.variation}): {outcome.failure}, at "
                f"{outcome.last_move!r}; unmet: {', '.join(outcome.unmet) or 'none'}",
                highlight=False,
                soft_wrap=True,
            )
