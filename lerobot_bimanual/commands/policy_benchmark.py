"""The command `policy benchmark`."""

import sys

from rich.console import Console

from lerobot_bimanual.benchmark.column import cells, run_column
from lerobot_bimanual.benchmark.config import BenchmarkConfig, command
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.run import check_task, count_variations, report, run, show
from lerobot_bimanual.terminal import show_next


def policy_benchmark(config: BenchmarkConfig) -> None:
    """Train a policy and score it on unseen seeds.

    Scores the expert and the open-loop baseline, generates demonstrations, trains with `lerobot-bimanual-train` (LeRobot's own
    loop, with the dataset in memory), and evaluates the last checkpoint with `lerobot-eval` on the test split; with
    --val_episodes the best one on the validation split (of equals the latest). The result is one JSON file in OUTPUT/results,
    read by `lerobot-bimanual results compare`.

    An interrupted benchmark continues where it stopped, a training from its last checkpoint. Of a finished one the result
    is shown again. Several policies and tasks are run one by one, or in lanes, each with a log in OUTPUT/logs.

    Examples:
        lerobot-bimanual policy benchmark --policy=peract2 --task=lift_ball
        lerobot-bimanual policy benchmark --policy=act --task=push_box --steps=20000 --device=cuda
        lerobot-bimanual policy benchmark --policy=peract2,peract_lf --task=all --protocol=standard --lanes=2
        lerobot-bimanual policy benchmark --recipe=paper --train_flags="--policy.dtype=bfloat16" --dry_run
    """
    console = Console()
    column = cells(config, tasks := [*count_variations(config.task)])
    if others := {*tasks} - {cell.task for cell in column}:
        print(f"left out: {', '.join(sorted(others))}, not in protocol {config.protocol}", file=sys.stderr)
    if len(column) > 1:
        if config.dry_run:
            console.print(*map(command, column), sep="\n", soft_wrap=True, highlight=False, markup=False)
        else:
            run_column(column, config.lanes)
            show_next("lerobot-bimanual", "results", "report", f"--results={config.output / 'results'}")
        return
    plan = Plan.of(column[0])
    check_task(plan.settings)
    if config.dry_run:
        show(plan, console)
    else:
        report(run(plan, console), plan, console)
        show_next("lerobot-bimanual", "results", "verify", f"--results={plan.result}")
