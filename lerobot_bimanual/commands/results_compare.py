"""The command `results compare`."""

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.results.benchmark import Scored, read_scored
from lerobot_bimanual.results.comparison import Comparison, check_trainings
from lerobot_bimanual.results.record import result_paths
from lerobot_bimanual.results.statistics import SuccessRate, holm
from lerobot_bimanual.terminal import print_table, say, show_next


@dataclass
class ResultsCompareConfig:
    """Flags of the command `results compare`."""

    # Result of one benchmark, or record of one evaluation, a JSON file, or a folder of them.
    first: Path = field(kw_only=True)
    second: Path = field(kw_only=True)  # another one on the same task and variation, or a folder
    first_policy: str | None = None  # policy to compare, from a folder with several
    second_policy: str | None = None  # likewise


def results_compare(config: ResultsCompareConfig) -> None:
    """Compare two policies episode by episode, on one task or on several.

    Pairs the episodes by seed and prints, per task, both success rates with their 95 % Wilson intervals, on how many episodes
    either was better, and the p-value of McNemar's exact test, also as corrected by Holm for the number of lines. Of policies
    that were trained several times, every training is shown, an episode counts once, with the mean over its trainings, and
    the p-value is the larger of two exact permutation tests: of signs, and of outcomes within episodes. The difference has two standard errors: from the draw
    of the episodes, and from the draw of the trainings.

    Examples:
        lerobot-bimanual results compare --first=results/peract2.json --second=results/act.json
        lerobot-bimanual results compare --first=results/leaderboard --second=outputs/board/results --second_policy=act
    """
    first = _results(config.first, config.first_policy, "first_policy")
    second = _results(config.second, config.second_policy, "second_policy")
    shared = sorted(first.keys() & second.keys())
    if not shared and len(first) == len(second) == 1:
        Comparison(*first.values(), *second.values())  # which says best in what they differ
    if not shared:
        raise BimanualError(
            f"no task is in both: {', '.join(sorted(first))} in {config.first}, {', '.join(sorted(second))} in "
            f"{config.second}"
        )
    comparisons = {place: Comparison(first[place], second[place]) for place in shared}
    for name, path, results in (("first", config.first, first), ("second", config.second, second)):
        say(f"{name:<7} {results[shared[0]][0].policy_id}, {path}")  # too long for a column
    _print_comparisons(comparisons)
    show_next("lerobot-bimanual", "results", "report", f"--results={config.first}")


def _results(path: Path, policy: str | None, flag: str) -> dict[str, tuple[Scored, ...]]:
    """Trainings of one policy in a file or folder, by what they are scored on."""
    results = {each: read_scored(each) for each in result_paths(path)}
    policies = sorted({result.policy_id for result in results.values()})
    if policy is None and len(policies) > 1:
        raise BimanualError(
            f"{path} holds results of several policies; choose one with --{flag}={'|'.join(policies)}"
        )
    if policy is not None and policy not in policies:
        raise InvalidChoice(flag, policy, policies)
    chosen = {each: one for each, one in results.items() if policy in (None, one.policy_id)}
    check_trainings(chosen)
    found: defaultdict[str, list[Scored]] = defaultdict(list)
    for result in chosen.values():
        found[result.eval_key].append(result)
    return {key: tuple(group) for key, group in found.items()}


def _print_comparisons(comparisons: dict[str, Comparison]) -> None:
    corrected = holm([comparison.p_value for comparison in comparisons.values()])
    table = pd.DataFrame(
        {
            "task": place,
            "first": _rates(comparison.rates[0]),
            "second": _rates(comparison.rates[1]),
            "difference": _difference(comparison),
            "better on": "{}, {}".format(*comparison.better),
            "p": f"{comparison.p_value:.3g}",
            "p (Holm)": f"{p_holm:.3g}",
        }
        for (place, comparison), p_holm in zip(comparisons.items(), corrected, strict=True)
    )
    print_table(table, "success on the same seeds")
    print("p and the first error are of the draw of the episodes, for these trainings.")
    if any(comparison.training_error is None for comparison in comparisons.values()):
        print("A single training of a policy does not show how much another training would differ.")


def _rates(rates: list[SuccessRate]) -> str:
    if len(rates) > 1:
        return f"{', '.join(str(rate.successes) for rate in rates)} of {rates[0].trials}"
    low, high = rates[0].interval
    return f"{rates[0].successes} of {rates[0].trials} ({low:.0%} to {high:.0%})"


def _difference(comparison: Comparison) -> str:
    text = f"{comparison.difference:+.1%} ± {comparison.episode_error:.1%} (episodes)"
    error = comparison.training_error
    return text if error is None else f"{text} ± {error:.1%} (trainings)"
