"""The commands of a benchmark, run one after the other, and what they give."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from itertools import batched

from rich.console import Console

from lerobot_bimanual.benchmark.episode_result import Validation, best_checkpoint, success_rate
from lerobot_bimanual.benchmark.measurements import (
    check_agreement,
    read_certificate,
    read_evaluation,
    read_record,
)
from lerobot_bimanual.benchmark.pipeline import Pipeline, show_command
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.results import PLACES, ROW_SCHEMA_VERSION, DatasetRecord, Machine, ResultRow
from lerobot_bimanual.checksums import sha256
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.record import EvaluationRecord, result_versions
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.statistics import SuccessRate, anytime_p_value
from lerobot_bimanual.terminal_table import print_table

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
    """Run what is not done yet, and write the result."""
    config, rival = plan.config, read_rival(plan)
    Pipeline(plan.source, console).run(plan.generation())
    shared = Pipeline(plan.folder, console)
    for control in ("expert", "blind"):
        shared.run(plan.certification(control))
    expert, blind = (
        read_certificate(plan.certificate(control), control, config.task, plan.seeds("test"))
        for control in ("expert", "blind")
    )
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
    tested = _test(plan, own, step) if rival is None else play_until_sure(plan, own, step, rival)
    seeds = [episode.seed for episode in tested.episodes]
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
        checkpoint_sha256=sha256(plan.weights(step)),
        validation=tuple(validations),
        split="test",
        options=tested.options,
        batch_size=tested.batch_size,
        episodes=tested.episodes,
        stopped_against=None if rival is None else rival.checkpoint_sha256,
        expert=tuple(episode for episode in expert.episodes if episode.seed in seeds),
        blind=tuple(episode for episode in blind.episodes if episode.seed in seeds),
        training_seconds=round(training.seconds(plan.training()), 1),
        machine=Machine.this(),
        versions=result_versions(),
        date=date.today().isoformat(),
    )
    write_file(plan.result, row.to_json())
    return row


def _test(plan: Plan, pipeline: Pipeline, step: int, seeds: range | None = None) -> EvaluationRecord:
    """Score a checkpoint on the test seeds, all or some of them."""
    pipeline.run(plan.evaluation("test", step, seeds))
    played = plan.seeds("test") if seeds is None else seeds
    record = read_record(plan.record_file("test", step, seeds), played)
    check_agreement(record, read_evaluation(plan.evaluation_file("test", step, seeds), played))
    return record


def read_rival(plan: Plan) -> ResultRow | None:
    """The row that a test goes against until it is sure which is better, looked at before anything runs; None without one.

    Raises:
        BimanualError: it is no row, of another task or variation, or has not played the seeds of the test.
    """
    path = plan.config.stop_when_sure
    if path is None:
        return None
    rival = ResultRow.read(path)
    for name in ("task", "variation"):
        if (got := getattr(rival, name)) != (wanted := getattr(plan.config, name)):
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
        records.append(_test(plan, pipeline, step, range(seeds[0], seeds[-1] + 1)))
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
    provenance = Provenance.read(plan.dataset)
    if provenance is None:
        raise BimanualError(
            f"{plan.dataset} does not say where it comes from; remove it to generate it again"
        )
    seeds = tuple(episode.seed for episode in provenance.episodes if episode.task == plan.config.task)
    return DatasetRecord(provenance.command, plan.protocol.image_size, seeds, dict(provenance.versions))


def _print_rates(title: str, rates: Mapping[str, SuccessRate]) -> None:
    """One row per entry of `rates`, who acted -> success, with the 95 % Wilson interval."""
    rows = []
    for who, rate in rates.items():
        low, high = rate.interval
        rows.append((who, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}"))
    print_table(("who acts", "solved", "95 % interval (Wilson)"), rows, title)
