"""The verb `certify`: how often the experts succeed, and how seldom their controls do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import InvalidChoice, check_range
from lerobot_env_bimanual.experts.control_names import EXPERTS, ControlName

if TYPE_CHECKING:
    from lerobot_env_bimanual.experts.campaign import Campaign
    from lerobot_env_bimanual.experts.outcome import Job

EACH_VARIATION = "each"


@dataclass
class ExpertEvaluateConfig:
    """Options of the verb `certify`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, `any` (drawn per episode) or `each` (every variation on all seeds)
    seeds: str = "0:100"  # half-open range a:b
    split: Literal["train", "val", "test"] = "test"  # the same seeds mean other episodes in each
    # Who plays: the expert; `noop` holds still; `random` plays keyposes from the whole workspace; `blind` plays the mean
    # keyposes of training episodes; `language_blind` does what one of the instructions that the scene allows asks for, at random; `rereading` is an expert
    # that begins again when a thing was moved and not by a hand.
    control: ControlName = "expert"
    discretise: int = 0  # voxels per axis to which the keyposes of a script are rounded; 0 leaves them exact
    # Play each of an expert's episodes again from its seed, by its joint actions or its keyposes, and compare the states.
    replay: Literal["none", "joint", "keypose"] = "none"
    # What is different from the world as it is: AXIS:LEVEL, several separated by commas.
    perturb: str = ""
    workers: int = 0  # processes; 0 takes one per core
    # Certificate, a JSON file; an interrupted run goes on from what lies beside it. Without it nothing is kept.
    output: Path | None = None


def expert_evaluate(config: ExpertEvaluateConfig) -> int:
    """Measure the success of an expert or a control over seeds.

    Prints the success rate of every variation with its 95 % Wilson interval, the median time of its episodes (of the
    robots, not of the computer), and for experts the worst tip error: the largest distance of a hand from its target at
    the end of a keypose, but for the one at which the episode ended. Below, each failure of an expert with its
    seed, last move and unmet conditions, and whatever else is not good enough. Exits with 1 if anything is: an
    expert (also `rereading`) below 99 % (97 % with rounded keyposes), a hand that did not arrive at a keypose, more than the real arm allows
    (torque, velocity, acceleration, jerk, contact force, finger speed, penetration), a replay through other states,
    keyframes that discovery does not find, a control that succeeds too often. The blind control plays the mean
    keyposes of 30 training episodes of the variation, whatever the scene. The control language_blind follows one of the
    instructions that the scene allows, at random; its successes are measured and not complained of.

    Examples:
        lerobot-bimanual expert evaluate --task=lift_ball --seeds=0:300 --output=certificate.json
        lerobot-bimanual expert evaluate --variation=each --replay=joint
        lerobot-bimanual expert evaluate --discretise=100
        lerobot-bimanual expert evaluate --control=blind --seeds=0:40
        lerobot-bimanual expert evaluate --task=lift_ball --perturb=mass:2
    """
    from lerobot_bimanual.output_file import check_output_file
    from lerobot_env_bimanual.experts.campaign import Campaign
    from lerobot_env_bimanual.experts.certificate import Certificate
    from lerobot_env_bimanual.experts.outcome_log import OutcomeLog
    from lerobot_env_bimanual.experts.seed_range import parse_seeds
    from lerobot_env_bimanual.perturbations.registry import checked_perturbation
    from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

    config = replace(config, perturb=checked_perturbation(config.perturb))
    names, seeds = resolve_tasks(config.task), parse_seeds(config.seeds)
    if config.variation != EACH_VARIATION:
        for name in names:
            get_task(name).spec.variation_index(config.variation)
    _check_effects(config)
    log = None
    if config.output is not None:
        check_output_file(config.output)
        log = OutcomeLog(config.output.with_suffix(".partial.jsonl"))
    try:
        with Campaign(config.workers, log) as campaign:
            jobs = [job for name in names for job in _jobs(campaign, config, name, seeds)]
            outcomes = campaign.play(jobs, config.control)
    except KeyboardInterrupt:
        kept = "the same command goes on where it stopped" if log else "nothing is kept without --output"
        raise KeyboardInterrupt(kept) from None
    certificate = Certificate(
        config.control,
        config.discretise,
        config.replay,
        config.split,
        config.seeds,
        tuple(outcomes),
        config.perturb,
    )
    if config.output is not None and log is not None:
        certificate.write(config.output)
        log.remove()
    certificate.print()
    return 1 if certificate.complaints else 0


def _check_effects(config: ExpertEvaluateConfig) -> None:
    """Refuse what would change nothing, for a certificate would claim it."""
    check_range("discretise", config.discretise, 0)
    if config.discretise and config.control not in EXPERTS:
        raise InvalidChoice(f"discretise of the control {config.control!r}", config.discretise, ["0"])
    if config.replay != "none" and config.control not in EXPERTS:
        raise InvalidChoice(f"replay of the control {config.control!r}", config.replay, ["none"])


def _jobs(campaign: Campaign, config: ExpertEvaluateConfig, task: str, seeds: Sequence[int]) -> Iterator[Job]:
    from lerobot_env_bimanual.experts.outcome import Job
    from lerobot_env_bimanual.options import ANY_VARIATION
    from lerobot_env_bimanual.tasks.registry import get_task

    blind = config.control == "blind"
    # The blind control may know its variation, as a policy does from the instruction: "any" is taken apart.
    apart = config.variation == EACH_VARIATION or (blind and config.variation == ANY_VARIATION)
    indices = map(str, range(len(get_task(task).spec.variations)))
    for variation in indices if apart else (config.variation,):
        keyposes = campaign.blind_keyposes(task, variation) if blind else ()
        job = Job(
            task,
            variation,
            config.split,
            0,
            config.control,
            config.discretise,
            keyposes,
            config.replay,
            config.perturb,
        )
        yield from (replace(job, seed=seed) for seed in seeds)
