"""The command `results diagnose`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.errors import InvalidChoice, check_range
from lerobot_bimanual.files import check_output_file, write_file
from lerobot_bimanual.terminal import print_table, say, show_next
from lerobot_env_bimanual.workers import WorkerPool

if TYPE_CHECKING:
    import pandas as pd

    from lerobot_bimanual.results.episode import Episode
    from lerobot_env_bimanual.failures.attribution import Attribution


@dataclass
class ResultsDiagnoseConfig:
    """Flags of `results diagnose`."""

    # A file, or a folder of files: results of `policy benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    # Results of one policy only, named as in the leaderboard: peract2, peract2_on_all. By default all.
    policy: str | None = None
    sample: int = 0  # random failed episodes of each result; 0 takes all
    sample_seed: int = 0  # seed of the random choice
    # JSON file with everything that was found.
    output: Path | None = None
    workers: int = 0  # processes; 0 takes one per core


def results_diagnose(config: ResultsDiagnoseConfig) -> int:
    """Say why episodes failed, at which keypose, and which arm is responsible.

    Each failed episode is replayed from its seed and classified by rules from physics. If it was played by keyposes, the
    expert takes over with both arms from a snapshot before each of them: the last keypose before which it still succeeds
    has lost the episode. There the keypose of one arm alone is replaced by the expert's: if that suffices, this arm is
    responsible; if either suffices, either; if neither does, their coordination. No weights are needed.

    Beside what is responsible for failures it prints how policies behave: the share of the expert's keyposes that they reach (1 in a
    solved episode), the median and the largest force of an episode's arms, and the median time of solved episodes over the
    expert's on the same seeds, as far as results hold these.

    Of tasks that can be done by several plans it also says how often both arms first follow the same one.

    Examples:
        lerobot-bimanual results diagnose --results=results/leaderboard --policy=peract2_on_all
        lerobot-bimanual results diagnose --results=outputs/eval/lift_ball_test_record.json
        lerobot-bimanual results diagnose --results=results/leaderboard --sample=5 --output=outputs/failures.json
    """
    import pandas as pd

    from lerobot_bimanual.results.record import result_paths
    from lerobot_env_bimanual.failures.agreement import FirstChoices
    from lerobot_env_bimanual.failures.attribution import FailureAttributor
    from lerobot_env_bimanual.failures.behaviour import behaviour
    from lerobot_env_bimanual.tasks.registry import get_task
    from lerobot_env_bimanual.verification.episodes import map_episodes
    from lerobot_env_bimanual.verification.result_files import ResultFile, sample_episodes

    check_range("sample", config.sample, 0)
    check_range("sample_seed", config.sample_seed, 0)
    if config.output is not None:
        check_output_file(config.output)
    results = [ResultFile.read(path) for path in result_paths(config.results)]
    if config.policy is not None:
        policies = sorted({result.policy_id for result in results})
        if config.policy not in policies:
            raise InvalidChoice("policy", config.policy, policies)
        results = [result for result in results if result.policy_id == config.policy]
    failures: dict[str, list[dict[str, Any]]] = {}
    choices: list[dict[str, Any]] = []
    groups: dict[str, list[Attribution]] = {}
    played: dict[str, list[Episode]] = {}
    expert_ticks: dict[str, dict[int, int]] = {}
    for result in results:
        result.check_world()
    with WorkerPool(config.workers) as pool:
        for result in results:
            episodes = result.record.episodes
            failed = [episode for episode in episodes if not episode.success]
            chosen = sample_episodes(failed, config.sample, config.sample_seed)
            named = {"name": lambda each, task=result.record.task: f"{task}, seed {each.seed}"}
            found = map_episodes(
                FailureAttributor, result.record, chosen, pool, "failure attribution", **named
            )
            groups.setdefault(result.name, []).extend(found)
            played.setdefault(result.name, []).extend(episodes)
            expert_ticks.setdefault(result.name, {}).update(result.expert_ticks)
            source = {"file": str(result.path), "policy": result.policy_id, "perturb": result.record.perturb}
            source["result"] = result.name
            task = result.record.task
            failures.setdefault(task, []).extend(source | asdict(one) for one in found)
            if len(get_task(task).spec.plans) > 1:
                firsts = map_episodes(FirstChoices, result.record, episodes, pool, "first choices", **named)
                choices += [source | one for one in firsts if one is not None]
            say(f"{result.path}: {len(episodes)} episodes of {task}, {len(failed)} failed")
            _print_episodes(found)
    print_table(_counts(groups, "failure_class").reset_index(), "Failures by class:")
    rows = {name: behaviour(played[name], groups[name], expert_ticks[name]) for name in groups}
    table = pd.DataFrame(rows).T.join(_counts(groups, "responsible")).rename_axis("result")
    print_table(table.reset_index(), "Behaviour, and failures by responsible arm:")
    if choices:
        _print_agreement(choices)
    if config.output is not None:
        found = {"failures": failures, "first_choices": choices}
        write_file(config.output, json.dumps(found, indent=1) + "\n")
    show_next("lerobot-bimanual", "results", "report", f"--results={config.results}")
    return 0


def _print_episodes(attributions: Sequence[Attribution]) -> None:
    import pandas as pd

    if attributions:
        columns = ["seed", "failure_class", "last_recoverable", "responsible", "event"]
        table = pd.DataFrame(attributions, columns=pd.Index(columns), dtype=object).map(
            lambda cell: "" if cell is None else cell
        )
        headings = {"failure_class": "class", "last_recoverable": "last recoverable keypose"}
        print_table(table.rename(columns=headings))


def _counts(groups: Mapping[str, Sequence[Attribution]], kind: str) -> pd.DataFrame:
    """How many failures of each result are of each class, or to whom they are attributed."""
    import pandas as pd

    names = [name for name, group in groups.items() for _ in group]
    kinds = [getattr(one, kind) for group in groups.values() for one in group]
    classes: Any = type(kinds[0]) if kinds else ()
    order = [each for each in classes if each in kinds]
    table = pd.crosstab(pd.Series(names, dtype=str), pd.Series(kinds, dtype=str))
    table = table.reindex(index=[*groups], columns=order, fill_value=0)
    return table.assign(failed=table.sum(axis=1)).rename_axis("result")


def _print_agreement(choices: Sequence[Mapping[str, Any]]) -> None:
    """Print in how many scenes that allow all plans both arms first followed the same one, and which the arms followed."""
    import pandas as pd

    from lerobot_bimanual.results.statistics import SuccessRate

    rows: list[dict[str, Any]] = []
    for name, group in pd.DataFrame(choices).groupby("result", sort=False):
        is_one = group.left_plan == group.right_plan
        agree = SuccessRate(int(is_one.sum()), len(group))
        pairs = group.value_counts(["left_plan", "right_plan"], sort=False).to_dict().items()
        counts = "; ".join(f"{left}, {right}: {count}" for (left, right), count in pairs)
        solved = {
            "of these solved": group.success[is_one].sum(),
            "of the others": group.success[~is_one].sum(),
        }
        rows.append({"result": name, "both arms agree": agree, **solved, "left, right plan": counts})
    print_table(pd.DataFrame(rows), "First choices where all plans are possible:")
