"""The verb `certify-rungs`: where on the ladder the experts still succeed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass
class ExpertEvaluatePerturbedConfig:
    """Options of the verb `certify-rungs`."""

    task: str = "all"  # task and suite names, comma separated
    axes: tuple[str, ...] = ()  # of perturbation; by default all that apply to a task
    levels: tuple[int, ...] = (1, 2, 3)  # of each axis; level 0, the world as it is, is always played
    seeds: str = "61000:61100"  # half-open range a:b of the split `test`, for the expert
    blind_seeds: str = "61000:61030"  # for the blind control
    workers: int = 0  # processes; 0 takes one per core
    output: Path = Path("results/certificates/rungs")  # folder; one small file per task


def expert_evaluate_perturbed(config: ExpertEvaluatePerturbedConfig) -> None:
    """Certify experts at every level of every axis: who solves how many, in one small file per task.

    Axes that change nothing but what is seen or said are left out, since there the expert and the blind control play as at
    level 0. A rung is certified if the expert solves 97 %; `ladder` and `robustness` mark others and count them nowhere. A
    file keeps the seeds of the expert's failures and of the blind control's successes; `certify --perturb=AXIS:LEVEL`
    plays them again, and says why; where an axis moves things later, such as nudge, with `--control=rereading`.

    An interrupted run goes on where it stopped. Rungs that a file already has are played again only if their world has
    changed, so that with further axes or levels it grows.

    Examples:
        lerobot-bimanual expert evaluate-perturbed
        lerobot-bimanual expert evaluate-perturbed --task=lift_ball --axes=mass,arm_late --levels=3 --output=outputs/rungs
    """
    from lerobot_bimanual.output_file import check_output_folder
    from lerobot_env_bimanual.experts.seed_range import parse_seeds
    from lerobot_env_bimanual.ladder.certification import RungCertification
    from lerobot_env_bimanual.ladder.rungs import rungs_of
    from lerobot_env_bimanual.tasks.registry import resolve_tasks

    seeds, blind_seeds = parse_seeds(config.seeds), parse_seeds(config.blind_seeds)
    chosen = {task: rungs_of(task, config.axes, config.levels) for task in resolve_tasks(config.task)}
    check_output_folder(config.output)
    for task, rungs in chosen.items():
        certification = RungCertification(task, rungs, seeds, blind_seeds, config.output / f"{task}.json")
        try:
            certificate = certification.certify(config.workers)
        except KeyboardInterrupt:
            raise KeyboardInterrupt("the same command goes on where it stopped") from None
        certified = [rung for rung in certificate.rungs if certificate.is_certified(rung)]
        print(f"{task}: {len(certified)} of {len(certificate.rungs)} rungs certified")
        for rung in certificate.rungs:
            if rung not in certified:
                rates = certificate.rates(rung)
                print(f"  not certified: {rung.name}, expert {rates['expert']}")
