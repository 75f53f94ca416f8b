"""The training protocol of the paper, run and reported."""

from collections.abc import Sequence
from datetime import date
from pathlib import Path

from rich.console import Console

from lerobot_bimanual.benchmark.pipeline import Pipeline, sha256, show_command
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.rates_table import success_table
from lerobot_bimanual.benchmark.results import (
    SCHEMA_VERSION,
    DatasetRecord,
    Machine,
    ResultRow,
    Validation,
    read_certificate,
    read_evaluation,
    success_rate,
    versions,
)
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.errors import BimanualError

PLACES = ("dataset.root", "output_dir")
"""Training flags that only say where things lie; a result does without them."""


def run(plan: Plan, console: Console) -> ResultRow:
    """Run the commands of a benchmark that are not done yet, and write its result."""
    config = plan.config
    pipeline = Pipeline(plan.folder, console)
    for stage in (plan.generation(), plan.certification("expert"), plan.certification("blind")):
        pipeline.run(stage)
    expert, blind = (read_certificate(plan.certificate(control)) for control in ("expert", "blind"))

    pipeline = Pipeline(plan.run_folder, console)
    training = plan.training()
    pipeline.run(training)
    validations = []
    for step in checkpoint_steps(plan.run_folder / "train" / "checkpoints"):
        pipeline.run(plan.evaluation("val", step))
        episodes = read_evaluation(plan.evaluation_file("val", step), config.first_seed)
        validations.append(Validation(step, episodes))
    best = best_checkpoint(validations)
    pipeline.run(plan.evaluation("test", best.step))

    row = ResultRow(
        schema_version=SCHEMA_VERSION,
        task=config.task,
        variation=config.variation,
        policy=config.policy,
        recipe=config.recipe,
        flags={name: value for name, value in plan.training_flags().items() if name not in PLACES},
        dataset=_dataset_record(plan.dataset),
        checkpoint_step=best.step,
        checkpoint_sha256=sha256(plan.weights(best.step)),
        validation=tuple(validations),
        split="test",
        episodes=read_evaluation(plan.evaluation_file("test", best.step), config.first_seed),
        expert=expert,
        blind=blind,
        training_seconds=round(pipeline.seconds(training), 1),
        machine=Machine.this(),
        versions=versions(),
        date=date.today().isoformat(),
    )
    plan.result.parent.mkdir(parents=True, exist_ok=True)
    plan.result.write_text(row.to_json())
    return row


def checkpoint_steps(folder: Path) -> list[int]:
    """Steps of the checkpoints in a folder, ascending."""
    return sorted(int(path.name) for path in folder.iterdir() if path.name.isdecimal())


def best_checkpoint(validations: Sequence[Validation]) -> Validation:
    """The checkpoint that solved most validation episodes; of equals the one trained longest."""
    return max(validations, key=lambda validation: (success_rate(validation.episodes).rate, validation.step))


def _dataset_record(folder: Path) -> DatasetRecord:
    provenance = Provenance.read(folder)
    if provenance is None:
        raise BimanualError(f"{folder} does not say where it comes from; remove it to generate it again")
    seeds = tuple(episode.seed for episode in provenance.episodes)
    return DatasetRecord(provenance.command, seeds, dict(provenance.versions))


def show(plan: Plan, console: Console) -> None:
    """Print the commands of a benchmark, as a script that would run it."""
    steps = sorted(
        {*range(plan.recipe.save_freq, plan.recipe.steps, plan.recipe.save_freq), plan.recipe.steps}
    )
    stages = [
        plan.generation(),
        plan.certification("expert"),
        plan.certification("blind"),
        plan.training(),
        *(plan.evaluation("val", step) for step in steps),
    ]
    for stage in stages:
        show_command(console, "", stage.command)
    console.print("# the best checkpoint of the validation, here as if it were the last one", highlight=False)
    show_command(console, "", plan.evaluation("test", steps[-1]).command)


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
    console.print(success_table(f"{row.task}, recipe {row.recipe}", validated | tested))
    for name, path in {"checkpoint": plan.checkpoint(row.checkpoint_step), "result": plan.result}.items():
        console.print(f"{name:<11} {path}", soft_wrap=True, highlight=False)
