"""The commands of a benchmark, run one after the other, and what they give."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from itertools import batched

from rich.console import Console

from lerobot_bimanual.benchmark.earlier_row import read_earlier
from lerobot_bimanual.benchmark.episode_result import Validation, best_checkpoint, success_rate
from lerobot_bimanual.benchmark.flag_text import command_flags
from lerobot_bimanual.benchmark.measurements import (
    Certified,
    check_agreement,
    read_certificate,
    read_evaluation,
    read_record,
)
from lerobot_bimanual.benchmark.pipeline import Pipeline, made_before, show_command
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.results import (
    PLACES,
    ROW_SCHEMA_VERSION,
    BadResult,
    ResultRow,
)
from lerobot_bimanual.benchmark.training_record import DatasetRecord, Machine
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.record import EvaluationRecord
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.results.statistics import SuccessRate, anytime_p_value
from lerobot_bimanual.tables import print_table

SEEDS_AT_A_TIME = 10
"""Between two looks at whether the test may stop; each is a start of `lerobot-eval`."""
SURE = 0.05
"""Share of comparisons of equal policies that may ever be called different."""


def show(plan: Plan, console: Console) -> None:
    """Print the commands of a benchmark, as a script that would run it."""
    *commands, test = plan.commands(plan.checkpoint_steps[-1])
    for command in commands:
        show_command(console, "", command.words)
    if plan.protocol.val_episodes:
        console.print(
            "# the best checkpoint of the validation, here as if it were the last one", highlight=False
        )
    show_command(console, "", test.words)


def run(plan: Plan, console: Console) -> ResultRow:
    """Run what is not done yet, and write the result.

    Raises:
        BimanualError: a command failed, what was measured at different times does not belong together, or the result of
            another measurement would be replaced.
    """
    config, rival = plan.config, read_rival(plan)
    earlier = read_earlier(plan, rival, plan.seeds("test")[:SEEDS_AT_A_TIME])
    Pipeline(plan.source, console).run(plan.generation())
    shared = Pipeline(plan.folder, console)
    for control in ("expert", "blind"):
        shared.run(plan.certification(control))
    expert, blind = (
        read_certificate(plan.certificate(control), control, config.task, plan.seeds("test"))
        for control in ("expert", "blind")
    )
    _check_one_world(plan, expert, blind)
    if rival is not None and rival.world != expert.world:
        raise BimanualError(
            f"{config.stop_when_sure} is of the world {rival.world} of {config.task}, but here it is {expert.world}; "
            "measure both in one world"
        )

    training, own = Pipeline(plan.training_folder, console), Pipeline(plan.run_folder, console)
    training.run(plan.training())
    validations = []
    for step in plan.checkpoint_steps if plan.protocol.val_episodes else ():
        own.run(plan.evaluation("val", step))
        episodes = read_evaluation(plan.evaluation_file("val", step), plan.seeds("val"))
        validations.append(Validation(step, episodes))
    step = best_checkpoint(validations).step if validations else plan.recipe.steps
    if rival is None:
        tested = _test(plan, own, step, expert.world)
    else:
        tested = play_until_sure(plan, own, step, rival)
    seeds, weights = [episode.seed for episode in tested.episodes], made_before(plan.weights(step))
    # A finished benchmark that is run again was neither trained nor played where and when that happens.
    trained = earlier if earlier is not None and earlier.checkpoint_sha256 == weights else None
    played = trained if trained is not None and trained.episodes == tested.episodes else None
    try:
        row = ResultRow(
            schema_version=ROW_SCHEMA_VERSION,
            task=config.task,
            world=expert.world,
            variation=config.variation,
            policy=config.policy,
            recipe=config.recipe,
            flags={name: value for name, value in plan.training_flags().items() if name not in PLACES},
            dataset=_dataset_record(plan),
            checkpoint_step=step,
            checkpoint_sha256=weights,
            validation=tuple(validations),
            split="test",
            options=tested.options,
            batch_size=tested.batch_size,
            episodes=tested.episodes,
            stopped_against=None if rival is None else rival.checkpoint_sha256,
            expert=tuple(episode for episode in expert.episodes if episode.seed in seeds),
            blind=tuple(episode for episode in blind.episodes if episode.seed in seeds),
            training_seconds=round(training.seconds(plan.training()), 1),
            machine=Machine.this() if trained is None else trained.machine,
            versions=tested.versions,
            date=date.today().isoformat() if played is None else played.date,
        )
    except ValueError as error:
        raise BadResult(
            f"what was measured for {plan.result} does not belong together: {error}; choose another --output to measure anew"
        ) from error
    write_file(plan.result, row.to_json())
    return row


def _check_one_world(plan: Plan, expert: Certified, blind: Certified) -> None:
    """Demonstrations and controls may have been made long before, but must be of today's versions and of one world.

    Raises:
        BadResult: they are not; the message names what differs.
    """
    provenance = _provenance(plan)
    for package, (recorded, installed) in provenance.other_versions().items():
        raise BadResult(
            f"{plan.dataset} was made with {package} {recorded}, but {installed} is installed, so a seed may mean another "
            f"episode; choose another --output, or remove {plan.dataset} and the trainings beside it"
        )
    task = plan.config.task
    worlds = {plan.certificate("expert"): expert.world, plan.certificate("blind"): blind.world}
    if plan.config.demos_perturb == plan.config.perturb:  # else they differ because they were told to
        worlds[plan.dataset] = provenance.worlds.get(task, "none")
    (one, world), *others = worlds.items()
    for path, other in others:
        if other != world:
            raise BadResult(
                f"{one} is of the world {world} of {task}, but {path} of {other}: it has changed between them; choose "
                "another --output, or remove the older one, of demonstrations with the trainings beside them"
            )


def _test(
    plan: Plan, pipeline: Pipeline, step: int, world: str, seeds: range | None = None
) -> EvaluationRecord:
    """Score a checkpoint on the test seeds, all or some of them, in the world of the controls."""
    pipeline.run(plan.evaluation("test", step, seeds))
    played = plan.seeds("test") if seeds is None else seeds
    path = plan.record_file("test", step, seeds)
    record = read_record(path, played)
    if record.world != world:
        raise BadResult(
            f"{path} is of the world {record.world} of {record.task}, but the controls in {plan.folder} are of {world}: it has "
            f"changed between them; choose another --output, or remove {path.parent} if that is the older"
        )
    check_agreement(record, read_evaluation(plan.evaluation_file("test", step, seeds), played))
    return record


def read_rival(plan: Plan) -> ResultRow | None:
    """The row that a test goes against until it is sure which is better, looked at before anything runs; None without one.

    Raises:
        BimanualError: it is no row, of another task, variation or perturbation, or has not played the seeds of the test.
    """
    path = plan.config.stop_when_sure
    if path is None:
        return None
    rival = ResultRow.read(path)
    of = {"task": rival.task, "variation": rival.variation, "perturb": rival.evaluation.perturb}
    for name, got in of.items():
        if got != (wanted := getattr(plan.config, name)):
            raise BimanualError(
                f"{path} is of the {name} {got!r}, but must be of {wanted!r}, as this benchmark is"
            )
    solved = {episode.seed for episode in rival.episodes}
    if missing := [seed for seed in plan.seeds("test") if seed not in solved]:
        raise BimanualError(
            f"{path} has not played the seeds {shown(missing)}; take fewer --test_episodes, or another --first_seed"
        )
    return rival


def play_until_sure(plan: Plan, pipeline: Pipeline, step: int, rival: ResultRow) -> EvaluationRecord:
    """Score a checkpoint on test seeds, a few at a time, until they say which of two policies is better, or are all played."""
    solved = {episode.seed: episode.success for episode in rival.episodes}
    records: list[EvaluationRecord] = []
    for seeds in batched(plan.seeds("test"), SEEDS_AT_A_TIME):
        records.append(_test(plan, pipeline, step, rival.world, range(seeds[0], seeds[-1] + 1)))
        episodes = [episode for record in records for episode in record.episodes]
        wins = sum(episode.success and not solved[episode.seed] for episode in episodes)
        losses = sum(not episode.success and solved[episode.seed] for episode in episodes)
        if anytime_p_value(wins, losses) <= SURE:
            break
    return replace(records[0], episodes=tuple(episode for record in records for episode in record.episodes))


def report(row: ResultRow, plan: Plan, console: Console) -> None:
    """Print the success rates, and where the result lies."""
    validated = {
        f"{row.policy} after {validation.step} steps (val)": success_rate(validation.episodes)
        for validation in row.validation
    }
    tested = {
        "expert (test)": row.rates["expert"],
        f"{row.policy} after {row.checkpoint_step} steps (test)": row.rates["policy"],
        "blind: mean keyposes of the training split (test)": row.rates["blind"],
    }
    console.rule("[bold]result[/bold]")
    _print_rates(f"{row.task}, recipe {row.recipe}", validated | tested)
    for name, path in {"checkpoint": plan.checkpoint(row.checkpoint_step), "result": plan.result}.items():
        console.print(f"{name:<11} {path}", soft_wrap=True, highlight=False)


def _dataset_record(plan: Plan) -> DatasetRecord:
    provenance = _provenance(plan)
    seeds = tuple(episode.seed for episode in provenance.episodes if episode.task == plan.config.task)
    command = provenance.command
    if plan.config.trained_on:
        # It names every task of a suite; the row says of what the policy bears the name.
        recorded = command_flags(command).get("task", "")
        command = command.replace(f"--task={recorded}", f"--task={plan.config.trained_on}")
    return DatasetRecord(command, plan.protocol.image_size, seeds, dict(provenance.versions))


def _provenance(plan: Plan) -> Provenance:
    provenance = Provenance.of_dataset(plan.dataset)
    if provenance is None:
        raise BimanualError(
            f"{plan.dataset} does not say where it comes from; remove it to generate it again"
        )
    return provenance


def _print_rates(title: str, rates: Mapping[str, SuccessRate]) -> None:
    """One row per entry of `rates`, who acted -> success, with the 95 % Wilson interval."""
    rows = []
    for who, rate in rates.items():
        low, high = rate.interval
        rows.append((who, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}"))
    print_table(("who acts", "solved", "95 % interval (Wilson)"), rows, title)
