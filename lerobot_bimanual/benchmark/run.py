"""Run the commands of a benchmark and collect their results."""

import json
import subprocess
import sys
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from lerobot_bimanual.benchmark.pipeline import Pipeline, show_command
from lerobot_bimanual.benchmark.plan import BASELINES, Plan
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.files import sha256
from lerobot_bimanual.results.benchmark import (
    INCIDENTAL,
    BenchmarkResult,
    BenchmarkSettings,
    Demonstrations,
    Machine,
    Validation,
)
from lerobot_bimanual.results.episode import Episode, success_rate
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.expert_report import ExpertReport
from lerobot_bimanual.results.protocols import TASKS
from lerobot_bimanual.results.record import BadRecord
from lerobot_bimanual.terminal import print_table


@cache
def count_variations(tasks: str) -> dict[str, int]:
    """Number of variations of each of the tasks and of the suites' tasks, whose names are separated by commas.

    Core knows the environment by its commands only, so a process of its own lists the tasks.

    Raises:
        BimanualError: no environment is installed, or there is no such task.
    """
    words = ("-m", "lerobot_bimanual.cli", "task", "list", f"--task={tasks}", "--format=json")
    answer = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    if answer.returncode:
        raise BimanualError(answer.stderr.strip().removeprefix("lerobot-bimanual: "))
    return {task["name"]: len(task["variations"]) for task in json.loads(answer.stdout)}


def check_task(settings: BenchmarkSettings) -> None:
    """Refuse tasks and variations that the environment does not know, before anything runs that takes minutes."""
    count = count_variations(settings.task)[settings.task]
    valid = f"'any', or from 0 to {count - 1}"
    for name in ("variation", "demos_variation"):
        for index in getattr(settings, name).split(","):
            if index not in ("", "any", *map(str, range(count))):
                raise InvalidChoice(f"{name} of {settings.task}", index, valid)
    if not settings.trained_on:
        return
    if settings.task not in (learned := count_variations(settings.trained_on)):
        raise BimanualError(
            f"trained_on is {settings.trained_on!r}, which does not contain {settings.task!r}; score one of: "
            f"{', '.join(learned)}"
        )
    if settings.protocol == "multitask" and {*learned} != {*TASKS}:
        raise BimanualError(
            f"trained_on is {settings.trained_on!r}, here {len(learned)} tasks, but the {len(TASKS)} of PerAct2 in the protocol multitask: uninstall "
            "the others, or name tasks"
        )


def show(plan: Plan, console: Console) -> None:
    """Print the commands of a benchmark, as a script that would run it."""
    console.print(f"# recipe: {plan.recipe.file}", highlight=False, soft_wrap=True)
    *commands, test = plan.commands(plan.settings.checkpoint_steps[-1])
    for command in commands:
        show_command(console, "", command.words)
    if plan.settings.val_episodes:
        console.print(
            "# the best checkpoint of the validation, here as if it were the last one", highlight=False
        )
    show_command(console, "", test.words)


def run(plan: Plan, console: Console) -> BenchmarkResult:
    """Run what is not done yet, and write the result; a result that is there already is returned as it is.

    Raises:
        BimanualError: a command failed, results of different times do not belong together, or the result of another
            measurement would be replaced.
    """
    settings = plan.settings
    if (made := _existing_result(plan)) is not None:
        if plan.video_dir is not None:
            console.print(
                f"no videos: {plan.result} is there already; remove it and the evaluations to play them again"
            )
        return made
    shared = Pipeline(plan.folder, console)
    worlds, reports = {}, {}
    for player in BASELINES:
        shared.run(plan.baseline(player))
        path = plan.report(player)
        worlds[path], reports[player] = _read_report(path, settings.task)
    Pipeline(plan.source, console).run(plan.generation())
    provenance = _provenance(plan)
    if settings.demos_perturb == settings.perturb:  # otherwise the worlds differ by intention
        worlds[plan.dataset] = provenance.worlds.get(settings.task, "none")
    _check_one_world(worlds, settings.task)

    training, own = Pipeline(plan.training_folder, console), Pipeline(plan.run_folder, console)
    trained_here, machine_file = training.run(plan.training()), plan.training_folder / "machine.json"
    if trained_here or not machine_file.is_file():
        Machine.this(settings.device).write(machine_file)
    validation, scores = [], {settings.steps: 0.0}
    for step in settings.checkpoint_steps if settings.val_episodes else ():
        own.run(plan.evaluation("val", step))
        played = EvaluationRecord.read(plan.record_file("val", step)).of_seeds(plan.seeds("val")).episodes
        solved = (Episode(seed=episode.seed, success=episode.success) for episode in played)
        validation.append(Validation(step=step, episodes=tuple(solved)))
        scores[step] = success_rate(played).rate
    # The best checkpoint, and of equally good ones the one that was trained longest.
    step = max(scores, key=lambda step: (scores[step], step))
    own.run(plan.evaluation("test", step))
    tested = EvaluationRecord.read(plan.record_file("test", step)).of_seeds(plan.seeds("test"))
    _check_one_world(worlds | {plan.record_file("test", step): tested.world}, settings.task)

    try:
        result = BenchmarkResult.of(
            schema_version=4,
            config=settings,
            world=tested.world,
            demonstrations=Demonstrations.of(
                settings=provenance.settings,
                seeds=tuple(each.seed for each in provenance.episodes if each.task == settings.task),
                versions=dict(provenance.versions),
            ),
            checkpoint_step=step,
            checkpoint_sha256=sha256(plan.weights(step)),
            training_seconds=round(training.seconds(plan.training()), 1),
            machine=Machine.read(machine_file),
            options=tested.options,
            batch_size=tested.batch_size,
            versions=tested.versions,
            date=date.today().isoformat(),
            validation=tuple(validation),
            episodes=tested.episodes,
            expert=reports["expert"],
            open_loop=reports["open_loop"],
        )
    except BadRecord as error:
        raise BadRecord(
            f"the measurements for {plan.result} do not belong together: {error}; choose another --output to measure again"
        ) from error
    result.write(plan.result)
    return result


def report(result: BenchmarkResult, plan: Plan, console: Console) -> None:
    """Print the success rates, where the result is stored, and what can be done with it."""
    policy = result.config.policy
    rates = {
        f"{policy} after {each.step} steps (val)": success_rate(each.episodes) for each in result.validation
    }
    rates |= {
        "expert (test)": result.rates["expert"],
        f"{policy} after {result.checkpoint_step} steps (test)": result.rates["policy"],
        "open loop: mean keyposes of the training split (test)": result.rates["open_loop"],
    }
    shown = {
        "agent": [*rates],
        "solved": [f"{rate.successes} of {rate.trials}" for rate in rates.values()],
        "95 % interval (Wilson)": ["{:.0%} to {:.0%}".format(*rate.interval) for rate in rates.values()],
    }
    console.rule("[bold]result[/bold]")
    print_table(pd.DataFrame(shown), f"{result.task}, recipe {result.config.recipe}")
    for name, path in (("checkpoint", plan.checkpoint(result.checkpoint_step)), ("result", plan.result)):
        console.print(f"{name:<11} {path}", soft_wrap=True, highlight=False)


def _existing_result(plan: Plan) -> BenchmarkResult | None:
    """The result of the same measurement if it is there already; that of another one is an error."""
    advice = "choose another --output"
    if not plan.result.exists():
        return None
    try:
        made = BenchmarkResult.read(plan.result)
    except BadRecord as error:
        raise BadRecord(f"{error}; {advice}, or move the file") from error
    for name in BenchmarkSettings.model_fields:
        got, asked = (
            _without_incidental_options(getattr(settings, name)) for settings in (made.config, plan.settings)
        )
        if got != asked:
            raise BimanualError(
                f"{plan.result} would be replaced: its {name} is {got!r}, not {asked!r}; {advice}"
            )
    return made


def _without_incidental_options(value: Any) -> Any:
    """A setting without the options of the training that decide nothing."""
    if not isinstance(value, dict):
        return value
    return {name: option for name, option in value.items() if name not in INCIDENTAL}


def _read_report(path: Path, task: str) -> tuple[str, tuple[Episode, ...]]:
    """World and episodes, sorted by seed and variation, of the report of the expert or a baseline on one task."""
    report = ExpertReport.read(path)
    episodes = sorted(report.episodes, key=lambda episode: (episode.seed, episode.variation))
    kept = {"seed", "variation", "success", "failure", "ticks", "state_hash"}
    return report.worlds[task], tuple(Episode(**episode.model_dump(include=kept)) for episode in episodes)


def _check_one_world(worlds: dict[Path, str], task: str) -> None:
    """Refuse files of different world versions; they may have been made at different times."""
    (first, world), *others = worlds.items()
    for path, other in others:
        if other != world:
            raise BimanualError(
                f"{path} is from world {other} of {task}, but {first} is from world {world}: the world has changed in between; "
                "choose another --output, or remove the older of the two and, if it is demonstrations, the trainings "
                "beside them"
            )


def _provenance(plan: Plan) -> Provenance:
    """Origin of the demonstrations, which must be of the installed versions."""
    provenance = Provenance.of_dataset(plan.dataset)
    if provenance is None:
        raise BimanualError(
            f"{plan.dataset} does not say where it comes from; remove it to generate it again"
        )
    for package, (recorded, installed) in provenance.other_versions().items():
        raise BimanualError(
            f"{plan.dataset} was made with {package} {recorded}, but {installed} is installed, so a seed may mean another "
            f"episode; choose another --output, or remove {plan.dataset} and the trainings beside it"
        )
    return provenance
