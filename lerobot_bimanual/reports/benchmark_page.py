"""Page of the results of many benchmarks, side by side."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import pandas as pd

from lerobot_bimanual.benchmark import recipes
from lerobot_bimanual.benchmark.config import beyond_recipe, command, shortest_config
from lerobot_bimanual.benchmark.plan import BASELINES
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.pages import render
from lerobot_bimanual.results.benchmark import INCIDENTAL, BenchmarkResult, Scored, read_scored
from lerobot_bimanual.results.comparison import check_comparable, table_key
from lerobot_bimanual.results.episode import success_rate, survival_rate
from lerobot_bimanual.results.evaluation import EvaluationRecord, combined_version
from lerobot_bimanual.results.protocols import OWN, PROTOCOLS
from lerobot_bimanual.results.record import result_paths
from lerobot_bimanual.results.statistics import SuccessRate, wilson_interval

ABSENT = "–"


def benchmark_page(results: Mapping[Path, Scored], folder: Path) -> str:
    """The page of results in a folder, by file.

    Raises:
        BimanualError: the results are not comparable, or no command trains one of an installed recipe again. The message names the file.
    """
    check_comparable(results)
    ordered = sorted(results.items(), key=lambda item: (item[1].eval_key, item[1].policy_id))
    trained = [(path, each) for path, each in ordered if isinstance(each, BenchmarkResult)]
    again, beyond = None, {}
    for path, each in trained:
        if each.config.recipe not in recipes.SIZES or each.config.policy not in entries(recipes.GROUP):
            continue
        try:
            config = shortest_config(each.config)
        except BimanualError as error:
            raise BimanualError(f"{path}: {error}") from error
        again, flags = command(config), beyond_recipe(config)
        beyond[path] = f"`{flags}`" if flags else ABSENT
    table: Any = results_table(results.values())
    return render(
        "lerobot_bimanual.reports",
        "benchmark.md",
        recipe=trained[0][1].config.recipe if trained else None,
        folder=folder.as_posix(),
        board=board_table(table),
        success={name: success_table(lines) for name, lines in table.groupby("protocol", observed=True)},
        worlds=worlds_table(results.values()),
        survival=survival_table(each for _, each in ordered),
        split=ordered[0][1].options["split"],
        training=_training_table(trained, beyond) if trained else None,
        command=again,
    )


def read_results(place: Path) -> dict[Path, Scored]:
    """The results in a file, or in the files of a folder, by file.

    Raises:
        BimanualError: there are none, one is wrong, or has the name of another result.
    """
    results = {path: read_scored(path) for path in result_paths(place)}
    for path, result in results.items():
        if isinstance(result, BenchmarkResult) and path.name != result.config.file_name:
            raise BimanualError(
                f"{path}: a file with this result must be named {result.config.file_name}; rename it"
            )
    return results


def results_table(results: Iterable[Scored]) -> pd.DataFrame:
    """One line per result, sorted, protocols in their order.

    Returns:
        Columns `protocol`, `task`, `policy`, `seed`, and the success rates `rate`, `expert` and `open_loop`. The last two are
        None where no benchmark has scored the same. Within a protocol, which says what policies learned from, `policy` is
        the policy's type; under `own` it is `policy_id`.
    """
    rows, baselines = [], {}
    for each in results:
        seed = each.policy.get("seed", 0) if isinstance(each, EvaluationRecord) else each.config.seed
        rows.append(
            {**_place(each), "key": table_key(each), "seed": seed, "rate": success_rate(each.episodes)}
        )
        if isinstance(each, BenchmarkResult):
            baselines[table_key(each)] = {name: each.rates[name] for name in BASELINES}
    absent = dict.fromkeys(BASELINES)
    table: Any = pd.DataFrame(row | baselines.get(row.pop("key"), absent) for row in rows)
    table["protocol"] = pd.Categorical(table.protocol, [*PROTOCOLS])
    return table.sort_values(["protocol", "task", "policy", "seed"], kind="stable")


def board_table(table: Any) -> pd.DataFrame:
    """Mean success of each policy, the expert and the open-loop baseline in a `results_table`, a column per protocol.

    A policy that was not scored on all tasks of a protocol has no mean. The 95 % interval is Wilson's for the draw of the
    episodes. Trainings share a task's episodes, so these count once, and all tasks as if each had the smallest number.
    """
    once = table.drop_duplicates(["protocol", "task"])
    baselines = [once.assign(policy=name, rate=once[name]) for name in BASELINES]
    policies = table.assign(policy=table.policy.map("`{}`".format))
    agents: Any = pd.concat([policies, *baselines]).dropna(subset="rate")
    tasks, board = once.groupby("protocol", observed=True).size(), {}
    for (protocol, agent), lines in agents.groupby(["protocol", "policy"], observed=True):
        by_task = lines.rate.map(lambda rate: rate.rate).groupby(lines.task).mean()
        mean, episodes = by_task.mean(), min(rate.trials for rate in lines.rate) * len(by_task)
        low, high = wilson_interval(mean * episodes, episodes)
        is_whole = lines.task.nunique() == tasks[protocol]
        cell = f"{mean:.1%} ({low:.0%} to {high:.0%})" if is_whole else ABSENT
        board.setdefault(f"`{protocol}`, {tasks[protocol]}", {})[agent] = cell
    order = [*sorted({*agents.policy} - {*BASELINES}), *BASELINES]
    shown = pd.DataFrame(board).reindex(order).fillna(ABSENT).rename(index={"open_loop": "open loop"})
    return shown.rename_axis("policy").reset_index()


def success_table(table: Any) -> pd.DataFrame:
    """Policies, expert and open-loop baseline side by side, one line per task, of the `results_table` of one protocol."""
    shown = table.pivot_table("rate", "task", "policy", _success_cell, fill_value=ABSENT)
    shown = shown.rename(index="`{}`".format, columns="`{}`".format)
    baselines = table.drop_duplicates("task")[[*BASELINES]]
    shown["expert"] = [ABSENT if rate is None else str(rate.successes) for rate in baselines.expert]
    shown["open loop"] = [ABSENT if rate is None else _score(rate) for rate in baselines.open_loop]
    return shown.rename_axis("task").reset_index()


def worlds_table(results: Iterable[Scored]) -> pd.DataFrame:
    """What to cite, a line per protocol: version of its tasks' worlds, MuJoCo's, test seeds, and days of the tests."""
    lines: dict[str, list[Scored]] = {}
    for each in results:
        lines.setdefault(_place(each)["protocol"], []).append(each)
    rows = []
    for name in (name for name in PROTOCOLS if name in lines):
        seeds = [episode.seed for each in lines[name] for episode in each.episodes]
        days = sorted(each.date for each in lines[name] if isinstance(each, BenchmarkResult))
        rows.append(
            {
                "protocol": f"`{name}`",
                "world": f"`{combined_version({_place(each)['task']: each.world for each in lines[name]})}`",
                "MuJoCo": ", ".join(sorted({each.versions["mujoco"] for each in lines[name]})),
                "test seeds": f"{min(seeds)} to {max(seeds)}",
                "tested": ABSENT if not days else " to ".join(dict.fromkeys((days[0], days[-1]))),
            }
        )
    return pd.DataFrame(rows)


def survival_table(results: Iterable[Scored]) -> pd.DataFrame | None:
    """Share of test episodes that real arms would have survived: mean and lowest of the tasks; None if no result has it."""
    rates = ((each, survival_rate(each.episodes)) for each in results)
    rows = [_place(each) | {"rate": rate.rate} for each, rate in rates if rate is not None]
    if not rows:
        return None
    table: Any = pd.DataFrame(rows)
    table["protocol"] = pd.Categorical(table.protocol, [*PROTOCOLS])
    by_task = table.groupby(["policy", "protocol", "task"], observed=True).rate.mean()
    shown = (
        by_task.groupby(["policy", "protocol"], observed=True).agg(_survival_cell).unstack(fill_value=ABSENT)
    )
    return shown.rename(index="`{}`".format, columns="`{}`".format).rename_axis("policy").reset_index()


def _survival_cell(by_task: Any) -> str:
    """The mean over tasks, and the lowest of several."""
    *_, task = by_task.idxmin()
    lowest = f"; `{task}` {by_task.min():.0%}" if len(by_task) > 1 and by_task.min() < 1 else ""
    return f"{by_task.mean():.1%}{lowest}"


def _place(result: Scored) -> dict[str, str]:
    """Protocol, task and policy of a result on the board."""
    if isinstance(result, EvaluationRecord) or result.config.protocol == OWN:
        return {"protocol": OWN, "task": result.eval_key, "policy": result.policy_id}
    return {"protocol": result.config.protocol, "task": result.task, "policy": result.config.policy}


def _training_table(results: Iterable[tuple[Path, BenchmarkResult]], beyond: Mapping[Path, str]) -> Any:
    """A line for all results of one policy with the same settings, whatever their seeds.

    Flags beyond the recipe are by file; files of policies whose recipe is not installed are missing.
    """
    table: Any = pd.DataFrame(
        {
            "policy": f"`{each.config.policy_id}`",
            "protocol": each.config.protocol,
            "results": each.config.eval_key,
            "demos": len(each.demonstrations.seeds),
            "steps": each.config.steps,
            "minutes": each.training_seconds / 60,
            "machine": each.machine.gpu or f"{each.machine.cpus} cores",
            "beyond the recipe": beyond.get(path)
            or f"not known, its recipe is not installed (settings {_digest(each)})",
        }
        for path, each in results
    )
    settings = ["policy", "protocol", "demos", "steps", "machine", "beyond the recipe"]
    lines = table.groupby(settings).agg({"results": "count", "minutes": _range}).reset_index()
    return lines[table.columns]


def _digest(result: BenchmarkResult) -> str:
    """Eight digits that tell the settings of trainings apart."""
    training = {name: value for name, value in result.config.training.items() if name not in INCIDENTAL}
    numbers = result.config.batch_size, result.config.image_size
    return hashlib.sha256(json.dumps([training, *numbers], sort_keys=True).encode()).hexdigest()[:8]


def _range(minutes: pd.Series) -> str:
    low, high = f"{minutes.min():.1f}", f"{minutes.max():.1f}"
    return low if low == high else f"{low} to {high}"


def _success_cell(rates: pd.Series) -> str:
    """Success of one training, or of several."""
    if len(rates) == 1:
        return _score(rates.iloc[0])
    shares = [rate.rate for rate in rates]
    counts = ", ".join(f"{rate.successes}/{rate.trials}" for rate in rates)
    return f"{counts}: {fmean(shares):.1%} ± {stdev(shares):.1%}"


def _score(rate: SuccessRate) -> str:
    low, high = rate.interval
    return f"{rate.successes}/{rate.trials} ({low:.0%} to {high:.0%})"
