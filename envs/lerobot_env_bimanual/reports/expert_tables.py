"""Expert reports as tables: experts and baselines, loads of the arms, and the tasks beside the paper's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median

import pandas as pd

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.episode import success_rate
from lerobot_bimanual.results.expert_report import (
    PLAYERS,
    EpisodeOutcome,
    ExpertReport,
    LoadMetrics,
    median_duration_s,
    worst_tip_error_mm,
)
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.load import BOUNDS
from lerobot_env_bimanual.experts.runner import OUT_OF_MOVES, OUT_OF_TIME
from lerobot_env_bimanual.reports.paper import ORIGINAL_ORACLE, ORIGINAL_ORACLE_MEAN, PAPER
from lerobot_env_bimanual.tasks.registry import get_task

EXACT, ROUNDED = "expert", "expert_discretised"
REPORTS = (EXACT, ROUNDED, *(name for name in PLAYERS if name != EXACT))
"""Names of the files, without `.json`."""
COLUMNS = (EXACT, ROUNDED, "open_loop", "random", "noop")
NOT_MEASURED = "–"


@dataclass(frozen=True)
class ExpertReports:
    """The expert reports of one folder, by name."""

    reports: Mapping[str, ExpertReport]

    @classmethod
    def read(cls, folder: Path) -> ExpertReports:
        """Read the reports of a folder.

        Raises:
            BimanualError: the folder has no report of the experts, or a file that is not such a report, not of the player of
                its name, or of another world, split or first seed than that of the experts.
        """
        paths = {name: folder / f"{name}.json" for name in REPORTS}
        if not paths[EXACT].is_file():
            raise BimanualError(
                f"{folder} holds no {EXACT}.json; `lerobot-bimanual expert evaluate --variation=each --replay=joint "
                f"--output={folder / EXACT}.json` writes it"
            )
        reports = {name: ExpertReport.read(path) for name, path in paths.items() if path.is_file()}
        experts = reports[EXACT]
        for name, report in reports.items():
            worlds = {task: experts.worlds.get(task) for task in report.worlds}
            player = EXACT if name == ROUNDED else name
            for field, got, expected in (
                ("player", report.player, player),
                ("perturb", report.perturb, ""),
                ("split", report.split, experts.split),
                ("first_seed", report.first_seed, experts.first_seed),
                ("worlds", report.worlds, worlds),
            ):
                if got != expected:
                    raise BimanualError(
                        f"{paths[name]}: {field} is {got!r}, but must be {expected!r} beside {EXACT}.json"
                    )
        return cls(reports)

    @property
    def tasks(self) -> list[str]:
        """Names of the tasks of the experts, in the paper's order."""
        return sorted(self.reports[EXACT].worlds, key=lambda name: get_task(name).spec.id)

    def variations(self, name: str, task: str) -> list[list[EpisodeOutcome]]:
        """Episodes of each variation of a task in one report; none if there is no such report."""
        report = self.reports.get(name)
        return (
            [] if report is None else [found for (of, _), found in report.by_variation.items() if of == task]
        )

    def rate(self, name: str, task: str) -> SuccessRate | None:
        """Success over all variations of a task; None if it was not measured."""
        episodes = [episode for found in self.variations(name, task) for episode in found]
        return success_rate(episodes) if episodes else None


def success_table(reports: ExpertReports) -> pd.DataFrame:
    """Experts and baselines, successes of trials per task."""
    headings = (
        "task",
        "expert",
        "rounded",
        "open loop",
        "random",
        "no-op",
        "words ignored (chance)",
    )
    rows = []
    for task in reports.tasks:
        cells = [_cell(reports.rate(name, task)) for name in COLUMNS]
        rows.append((f"`{task}`", *cells, _language_ablated(reports, task)))
    return pd.DataFrame(rows, columns=[*headings])


def _language_ablated(reports: ExpertReports, task: str) -> str:
    rate = reports.rate("language_ablated", task)
    return _cell(rate) if rate is None else f"{_cell(rate)} ({_chance(task):.0%})"


def _chance(task: str) -> float:
    """Success rate of a player that follows any of the instructions that the scene allows, on average over variations."""
    env, shares = BimanualEnv(task, split="val", obs="state"), []
    for variation in get_task(task).spec.variations:
        env.reset(seed=0, options={"variation": variation.index})
        shares.append(1 / len(env.task_definition.readings(env.scene)))
    env.close()
    return fmean(shares)


def _cell(rate: SuccessRate | None) -> str:
    return NOT_MEASURED if rate is None else f"{rate.successes}/{rate.trials}"


def evidence_table(reports: ExpertReports) -> pd.DataFrame:
    """Measurements of the exact expert's episodes."""
    headings = (
        "task",
        "lowest of a variation's 95 % interval",
        "replayed bit for bit",
        "keyframes found again",
        "largest tip error",
        "planner failures",
        "lines replaced",
        "placements accepted",
    )
    rows = []
    for task in reports.tasks:
        variations = reports.variations(EXACT, task)
        episodes = [episode for found in variations for episode in found]
        solved = [episode for episode in episodes if episode.success]
        failures = [episode.failure for episode in episodes]
        rows.append(
            (
                f"`{task}`",
                f"{min(success_rate(found).interval[0] for found in variations):.1%}",
                f"{sum(bool(episode.replayed) for episode in solved)}/{len(solved)}",
                f"{sum(bool(episode.keyframes_found) for episode in solved)}/{len(solved)}",
                f"{worst_tip_error_mm(solved):.1f} mm",
                sum(failure not in (None, OUT_OF_MOVES, OUT_OF_TIME) for failure in failures),
                sum(episode.line_fallbacks for episode in episodes),
                f"{len(episodes) / sum(episode.draws for episode in episodes):.0%}",
            )
        )
    return pd.DataFrame(rows, columns=[*headings])


def paper_table(reports: ExpertReports) -> pd.DataFrame:
    """Variations, items, keyframes, duration and oracle, here and in the paper."""
    headings = ("task", "variations", "items", "keyframes", "duration", "oracle of the original")
    rows = []
    for task in reports.tasks:
        spec, paper, variations = get_task(task).spec, PAPER.get(task), reports.variations(EXACT, task)
        oracle = ORIGINAL_ORACLE.get(task)
        rows.append(
            (
                f"`{task}`",
                len(spec.variations),
                f"{movable_items(task)} ({paper.items if paper else NOT_MEASURED})",
                f"{_mean(variations, lambda solved: median(len(episode.moves) for episode in solved)):.1f} "
                f"({paper.keyframes if paper else NOT_MEASURED})",
                f"{_mean(variations, median_duration_s):.1f} s "
                f"({f'{paper.duration_s:.1f} s' if paper else NOT_MEASURED})",
                NOT_MEASURED if oracle is None else f"{oracle:.0%}",
            )
        )
    rows.append(("all", sum(row[1] for row in rows), "", "", "", f"{ORIGINAL_ORACLE_MEAN:.1%}"))
    return pd.DataFrame(rows, columns=[*headings])


def load_table(reports: ExpertReports) -> pd.DataFrame:
    """The peaks of the experts' episodes beside their bounds."""
    headings = (
        "task",
        "torque",
        "a motor at its limit",
        "velocity",
        "acceleration",
        "jerk",
        "contact force",
        "finger speed",
        "penetration",
        "contact force, rounded",
    )
    rows = [("*at most*", *_load_cells(LoadMetrics(**BOUNDS, penetrating="")), "")]
    for task in reports.tasks:
        exact = reports.reports[EXACT].load(task)
        rounded = reports.reports[ROUNDED].load(task) if ROUNDED in reports.reports else None
        assert exact is not None  # every reports task has rows of the exact expert
        cell = NOT_MEASURED if rounded is None else f"{rounded.contact_force_n:.0f} N"
        rows.append((f"`{task}`", *_load_cells(exact), cell))
        if own := get_task(task).spec.load_bounds:
            rows.append(
                (
                    f"*at most in `{task}`*",
                    *_load_cells(LoadMetrics(**BOUNDS | dict(own), penetrating="")),
                    "",
                )
            )
    return pd.DataFrame(rows, columns=[*headings])


def excess_sentence(reports: ExpertReports) -> str:
    """Which of the exact experts' episodes ask for more than the bounds."""
    violations = reports.reports[EXACT].violations
    played = len(reports.reports[EXACT].episodes)
    if not violations:
        return f"None of the {played} episodes is beyond its bounds."
    return f"Of the {played} episodes {len(violations)} are beyond a bound: {'; '.join(violations)}."


def _load_cells(load: LoadMetrics) -> tuple[str, ...]:
    return (
        f"{load.torque:.0%}",
        f"{load.saturated:.1%}",
        f"{load.velocity:.0%}",
        f"{load.acceleration:.0%}",
        f"{load.jerk:.0%}",
        f"{load.contact_force_n:.0f} N",
        f"{load.finger_speed_m_s:.2f} m/s",
        f"{load.penetration_mm:.1f} mm" + (f" ({load.penetrating})" if load.penetrating else ""),
    )


def movable_items(task: str) -> int:
    """Things of the scene that can move by themselves: free objects, and each door, drawer or button."""
    from lerobot_bimanual.arms import ARMS
    from lerobot_env_bimanual.world.scene import Scene

    return Scene(get_task(task).spec.props).model.ntree - len(ARMS)


def _mean(
    variations: Sequence[Sequence[EpisodeOutcome]], value: Callable[[Sequence[EpisodeOutcome]], float]
) -> float:
    """Mean over variations of a value of their solved episodes, weighted by their episodes."""
    solved = [[episode for episode in found if episode.success] for found in variations]
    weights = [len(found) for found in variations]
    return sum(value(each) * weight for each, weight in zip(solved, weights, strict=True)) / sum(weights)
