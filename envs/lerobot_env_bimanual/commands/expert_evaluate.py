"""The command `expert evaluate`: how often the experts succeed, and how seldom the baselines do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lerobot_bimanual.errors import BimanualError, InvalidChoice, check_range
from lerobot_bimanual.files import check_output_file, check_output_folder
from lerobot_bimanual.perturbation_levels import parse_levels
from lerobot_bimanual.results.expert_report import ExpertReport, PlayerName
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.options import ANY_VARIATION, STANDARD
from lerobot_env_bimanual.registry import checked_perturbation
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

if TYPE_CHECKING:
    from lerobot_env_bimanual.sweep.evaluator import EpisodeSpec, Evaluator

EACH_VARIATION = "each"
ALL_AXES = ("all",)
SHARED = ("player", "discretise", "replay", "split", "perturb", "setting", "plan")
"""Options that are fields of a report and of each of its episodes."""


@dataclass
class ExpertEvaluateConfig:
    """Options of the command `expert evaluate`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, `any` (drawn per episode) or `each` (every variation on all seeds)
    first_seed: int = 0  # seed of the first episode of each task, or of each of its variations
    episodes: int = 100  # number of episodes, on consecutive seeds
    split: Literal["train", "val", "test"] = "test"  # the same seeds mean other episodes in each
    # `expert`; `replanning`, an expert that starts again after something other than a hand has moved a thing; `noop` holds
    # still; `random` plays keyposes from the whole workspace; `open_loop` repeats the mean keyposes of training episodes;
    # `nearest` repeats those of the one training episode, of 100, whose scene is most alike; `language_ablated` follows one
    # of the instructions that the scene allows, at random; `mixed` moves the left arm by one plan and the right one by another.
    player: PlayerName = "expert"
    plan: int = 0  # number of the plan of the player `expert`, in tasks that can be done in several ways
    discretise: int = 0  # voxels per axis to which the keyposes of an expert are rounded; 0 leaves them exact
    # Play each solved episode of an expert again from its seed, by its joint actions or its keyposes, and compare the states.
    replay: Literal["none", "joint", "keypose"] = "none"
    # in `varied` sizes, heights and places of things differ more
    setting: Literal["standard", "varied"] = "standard"
    perturb: str = ""  # perturbations of the world, AXIS:LEVEL, several separated by commas
    # Axes of a sweep over conditions, or `all` that apply to a task; by default there is no sweep.
    axes: tuple[str, ...] = ()
    levels: tuple[int, ...] = (1, 2, 3)  # levels of each axis; the nominal world is always added
    open_loop_episodes: int = 30  # episodes of the open-loop baseline in each condition of a sweep
    workers: int = 0  # processes; 0 takes one per core
    # Report, a JSON file; of a sweep the folder of the reports, one file per task. Without it nothing is kept.
    output: Path | None = None


def expert_evaluate(config: ExpertEvaluateConfig) -> int:
    """Measure the success of an expert or a baseline over seeds, in one world or over conditions.

    Prints the success rate of every variation with its 95 % Wilson interval, the median duration of its episodes (of the
    robots), and for experts the worst tip error: the largest distance of a hand from its target at the end of a keypose
    that did not end the episode. Then it prints each failure of an expert with its seed, last move and unmet conditions,
    and every violation. Exits with 1 if there is one: an expert below 99 % (97 % with rounded keyposes), a hand that did
    not arrive at a keypose, loads beyond the limits of the real arm (torque, velocity, acceleration, jerk, contact force,
    finger speed, penetration), a replay through other states, keyframes that discovery does not find, a baseline that
    succeeds too often. The open-loop baseline plays the mean keyposes of 30 training episodes of the variation in every
    scene.

    With --axes it evaluates the expert and the open-loop baseline in every condition, one axis at one level, and writes one
    small file per task. Axes that change only what is seen or said are left out, since these players act there as in the
    nominal world. A condition is valid if the expert solves 97 %; `policy robustness` counts no other. A file keeps the
    seeds of the expert's failures; `--perturb=AXIS:LEVEL` plays them again and says why they failed. Axes that move things
    during an episode, such as nudge, need `--player=replanning` for that. Conditions that a file already has are played
    again only if their world has changed; those of further axes or levels are added.

    An interrupted run with --output continues where it stopped. An existing report is extended: tasks that it has with the
    same options, versions and world are not played again, and its other tasks stay. A report of other options is replaced.

    Examples:
        lerobot-bimanual expert evaluate --task=lift_ball --episodes=300 --output=outputs/expert.json
        lerobot-bimanual expert evaluate --variation=each --replay=joint
        lerobot-bimanual expert evaluate --player=open_loop --episodes=40
        lerobot-bimanual expert evaluate --task=lift_ball --perturb=mass:2 --discretise=100
        lerobot-bimanual expert evaluate --task=lift_ball --axes=mass,arm_late --levels=3 --output=outputs/perturbed
    """
    config = replace(config, perturb=checked_perturbation(config.perturb))
    tasks = resolve_tasks(config.task)
    _check(config, tasks)
    try:
        return _sweep(config, tasks) if config.axes else _evaluate(config, tasks)
    except KeyboardInterrupt:
        continues = "the same command continues where it stopped"
        raise KeyboardInterrupt(continues if config.output else "nothing is kept without --output") from None


def _check(config: ExpertEvaluateConfig, tasks: tuple[str, ...]) -> None:
    """Refuse impossible options, and options that would have no effect although the report would state them."""
    plan = 1 if config.player == "mixed" else config.plan
    for spec in (get_task(task).spec for task in tasks):
        if config.variation != EACH_VARIATION:
            spec.variation_index(config.variation)
        if plan not in range(len(spec.plans)):
            plans = [f"{nth} ({name})" for nth, name in enumerate(spec.plans)]
            raise InvalidChoice(f"plan of {spec.name}", plan, plans)
    for name, minimum in (("first_seed", 0), ("episodes", 1), ("open_loop_episodes", 1), ("discretise", 0)):
        check_range(name, getattr(config, name), minimum)
    fixed = {"expert": (), "replanning": ("plan",)}.get(config.player, ("discretise", "replay", "plan"))
    for name in fixed:
        if (value := getattr(config, name)) != (usual := getattr(ExpertEvaluateConfig, name)):
            raise InvalidChoice(f"{name} of the player {config.player!r}", value, [str(usual)])
    if config.replay == "joint" and (
        axes := {"command_noise", "misses"} & parse_levels(config.perturb).keys()
    ):
        option = f"replay under {', '.join(sorted(axes))}, where joint actions do not repeat every hash,"
        raise InvalidChoice(option, config.replay, ["none", "keypose"])
    if not config.axes and config.levels != ExpertEvaluateConfig.levels:
        raise InvalidChoice("axes", config.axes, "given with --levels, such as --axes=mass or --axes=all")
    if config.axes:
        if config.output is None:
            raise BimanualError(
                "--axes needs --output=FOLDER, where each task gets a report, as in --output=outputs/perturbed"
            )
        for name in ("player", "plan", "variation", "setting", "perturb", "discretise", "replay"):
            if (value := getattr(config, name)) != (usual := getattr(ExpertEvaluateConfig, name)):
                raise InvalidChoice(f"{name} with --axes", value, [repr(usual)])


def _evaluate(config: ExpertEvaluateConfig, tasks: tuple[str, ...]) -> int:
    from lerobot_env_bimanual.experts.report import make_report, print_report
    from lerobot_env_bimanual.experts.world_version import simulation_versions
    from lerobot_env_bimanual.sweep.evaluator import EpisodeLog, Evaluator

    head: dict[str, Any] = {name: getattr(config, name) for name in (*SHARED, "first_seed")}
    head["n_seeds"] = config.episodes
    log = report = None
    if config.output is not None:
        check_output_file(config.output)
        log = EpisodeLog(config.output.with_suffix(".partial.jsonl"), exclusive=True)
        report = _earlier(config.output, head | {"versions": simulation_versions()})
    with Evaluator(config.workers, log) as evaluator:
        for task in tasks:
            if report and _is_played(config, report, task):
                continue
            specs = [*_specs(evaluator, config, task)]
            found = make_report(evaluator.play(specs, f"{task}: {config.player}"), **head)
            report = report.with_tasks_of(found) if report else found
            if config.output is not None:
                report.write(config.output)
        if log is not None:
            log.remove()
    assert report is not None  # there is a task
    print_report(report)
    if report.violations:
        return 1
    given = (
        f"--{name}={value}"
        for name in ("setting", "perturb")
        if (value := getattr(config, name)) not in ("", STANDARD)
    )
    root = f"--root=data/{config.task.replace(',', '_')}"
    show_next("lerobot-bimanual", "dataset", "generate", f"--task={config.task}", *given, root)
    return 0


def _earlier(path: Path, head: dict[str, Any]) -> ExpertReport | None:
    """The report that an earlier run with the same options and versions left in a file; None if there is none."""
    report = ExpertReport.read(path) if path.exists() else None
    return report if report and all(getattr(report, name) == value for name, value in head.items()) else None


def _is_played(config: ExpertEvaluateConfig, report: ExpertReport, task: str) -> bool:
    """Whether a report has all episodes of a task, in the present world."""
    from lerobot_env_bimanual.episode.progress import draw_episode
    from lerobot_env_bimanual.experts.world_version import world_version

    spec = get_task(task).spec
    asked = product(map(spec.variation_index, _variations(config, task)), report.seeds)
    drawn = (draw_episode(spec, config.split, seed, index, config.setting) for index, seed in asked)
    return {(each.variation.index, each.seed) for each in drawn} == {
        (each.variation, each.seed) for each in report.of_task(task)
    } and report.worlds[task] == world_version(task, config.perturb, config.setting)


def _variations(config: ExpertEvaluateConfig, task: str) -> tuple[str, ...]:
    """The variations, each played on all seeds."""
    # The open-loop baseline may know its variation, as a policy does from the instruction: "any" is taken apart.
    apart = (EACH_VARIATION, ANY_VARIATION) if config.player == "open_loop" else (EACH_VARIATION,)
    indices = range(len(get_task(task).spec.variations))
    return tuple(map(str, indices)) if config.variation in apart else (config.variation,)


def _specs(evaluator: Evaluator, config: ExpertEvaluateConfig, task: str) -> Iterator[EpisodeSpec]:
    """The episodes of a task, by variation and seed."""
    from lerobot_env_bimanual.sweep.evaluator import EpisodeSpec

    shared = {name: getattr(config, name) for name in SHARED}
    for variation in _variations(config, task):
        if config.player == "open_loop":
            shared["mean_keyposes"] = evaluator.mean_keyposes(task, variation, config.setting)
        for seed in range(config.first_seed, config.first_seed + config.episodes):
            yield EpisodeSpec(task, variation, seed=seed, **shared)


def _sweep(config: ExpertEvaluateConfig, tasks: tuple[str, ...]) -> int:
    from lerobot_bimanual.results.robustness import ExpertRobustnessConfig, is_valid
    from lerobot_env_bimanual.experts.world_version import simulation_versions
    from lerobot_env_bimanual.sweep.conditions import Conditions, NothingToChange, conditions_of, sweep_expert

    assert config.output is not None  # checked
    axes = () if config.axes == ALL_AXES else config.axes
    chosen: dict[str, Conditions] = {}
    for task in tasks:
        try:
            chosen[task] = conditions_of(task, axes, config.levels)
        except NothingToChange as error:
            if not chosen and task == tasks[-1]:
                raise
            print(f"{task} is left out: {error}")
    check_output_folder(config.output)
    for task, conditions in chosen.items():
        measured = ExpertRobustnessConfig(
            task=task,
            split=config.split,
            first_seed=config.first_seed,
            expert_episodes=config.episodes,
            open_loop_episodes=min(config.open_loop_episodes, config.episodes),
            versions=simulation_versions(),
        )
        report = sweep_expert(conditions, measured, config.output / f"{task}.json", config.workers)
        invalid = [each for each in report.conditions if not is_valid(report.rates(each)["expert"])]
        count = len(report.conditions)
        print(f"{task}: {count - len(invalid)} of {count} conditions are valid")
        for condition in invalid:
            print(f"  not valid: {condition.name}, expert {report.rates(condition)['expert']}")
    checkpoint = "--checkpoint=results/checkpoints/peract2_on_all"
    flags = (f"--task={next(iter(chosen))}", f"--expert_reports={config.output}", checkpoint)
    show_next("lerobot-bimanual", "policy", "robustness", *flags)
    return 0
