"""Expert reports as the page of all tasks: experts and baselines, loads of the arms, and the tasks beside the paper's."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Self

import pandas as pd

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import BimanualError, plain, shown
from lerobot_bimanual.pages import render
from lerobot_bimanual.results.episode import LoadMetrics, success_rate
from lerobot_bimanual.results.evaluation import combined_version
from lerobot_bimanual.results.expert_report import (
    PLAYERS,
    EpisodeOutcome,
    ExpertReport,
    median_duration_s,
    worst_tip_error_mm,
)
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.load import BOUNDS
from lerobot_env_bimanual.options import SETTINGS, STANDARD
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.scene import Scene

EXACT, ROUNDED, LANGUAGE_ABLATED = "expert", "expert_discretised", "language_ablated"
ROUNDED_VOXELS = 100
"""Per axis of the grid on which rounded keyposes lie: that of the paper's policies."""
REPORTS = (EXACT, ROUNDED, *(name for name in PLAYERS if name != EXACT))
"""Names of the files, without `.json`."""
COLUMNS = {
    EXACT: "expert",
    ROUNDED: "rounded",
    "open_loop": "open loop",
    "nearest": "nearest",
    "random": "random",
    "noop": "no-op",
    LANGUAGE_ABLATED: "words ignored (chance)",
}
"""Headings of the table of success, by name of the report."""
NOT_MEASURED = "–"


PAPER = tomllib.loads(Path(__file__).with_name("paper.toml").read_text(encoding="utf-8"))
ORIGINAL_ORACLE_MEAN = 0.858
"""Success of ground-truth keyposes replayed in the original simulator, over all thirteen tasks (appendix C.10 of 3D FlowMatch
Actor, arXiv 2508.11002)."""


@dataclass(frozen=True)
class ExpertReports:
    """The expert reports of one setting, by name."""

    reports: Mapping[str, ExpertReport]

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the reports of a folder that has the name of their setting.

        Raises:
            BimanualError: the folder has no report of the experts, or one without a solved episode of a variation; or a file that
                is not such a report, not of the player or setting of its name, or of another world, split or first seed than
                that of the experts.
        """
        paths = {name: folder / f"{name}.json" for name in REPORTS}
        if not paths[EXACT].is_file():
            raise BimanualError(
                f"{folder} holds no {EXACT}.json; `lerobot-bimanual expert evaluate --variation=each --replay=joint "
                f"--setting={folder.name} --output={folder / EXACT}.json` writes it"
            )
        reports = {name: ExpertReport.read(path) for name, path in paths.items() if path.is_file()}
        experts = reports[EXACT]
        for name, report in reports.items():
            shared = {
                "perturb": "",
                "setting": folder.name,
                "split": experts.split,
                "first_seed": experts.first_seed,
                "plan": 0,
                "discretise": ROUNDED_VOXELS if name == ROUNDED else 0,
            }
            shared["player"] = EXACT if name == ROUNDED else name
            shared["worlds"] = {task: experts.worlds.get(task) for task in report.worlds}
            for field, expected in shared.items():
                if (got := getattr(report, field)) != expected:
                    raise BimanualError(
                        f"{paths[name]}: {field} is {shown(got)}, but must be {shown(expected)} beside {EXACT}.json"
                    )
        for (task, variation), episodes in experts.by_variation.items():
            if experts.load(task) is None or not any(episode.success for episode in episodes):
                raise BimanualError(
                    f"{paths[EXACT]}: no episode of {plain(task)}, variation {variation}, was solved and measured"
                )
        return cls(reports)

    @property
    def tasks(self) -> list[str]:
        """Names of the tasks of the experts, in the paper's order."""
        return sorted(self.reports[EXACT].worlds, key=lambda name: get_task(name).spec.id)

    def variations(self, task: str) -> list[list[EpisodeOutcome]]:
        """The experts' episodes of each variation of a task."""
        return [found for (of, _), found in self.reports[EXACT].by_variation.items() if of == task]


def success_table(reports: ExpertReports) -> pd.DataFrame:
    """Experts and baselines, successes of episodes per task, and means of the tasks' rates."""
    cells, rates = dict[tuple[str, str], str](), dict[str, list[float]]()
    for name, heading in COLUMNS.items():
        for task in reports.tasks:
            episodes = reports.reports[name].of_task(task) if name in reports.reports else []
            if not episodes:
                continue
            rate = success_rate(episodes)
            chance = f" ({_chance(task):.0%})" if name == LANGUAGE_ABLATED else ""
            cells[f"`{task}`", heading] = f"{rate.successes}/{rate.trials}{chance}"
            rates.setdefault(heading, []).append(rate.rate)
    for heading, found in rates.items():
        cells["mean", heading] = f"{fmean(found):.1%}"
    rows = [f"`{task}`" for task in reports.tasks] + ["mean"]
    return pd.DataFrame(
        {"task": row, **{heading: cells.get((row, heading), NOT_MEASURED) for heading in COLUMNS.values()}}
        for row in rows
    )


def _chance(task: str) -> float:
    """Success rate of a player that follows any of the instructions that the scene allows, on average over variations."""
    env, shares = BimanualEnv(task, split="val", obs="state"), []
    for variation in get_task(task).spec.variations:
        env.reset(seed=0, options={"variation": variation.index})
        shares.append(1 / len(env.task_definition.scripts_for_all_instructions(env.scene)))
    env.close()
    return fmean(shares)


def evidence_table(reports: ExpertReports) -> pd.DataFrame:
    """Measurements of the episodes of the experts with exact keyposes."""
    rows = []
    for task in reports.tasks:
        variations = reports.variations(task)
        episodes = [episode for found in variations for episode in found]
        solved = [episode for episode in episodes if episode.success]
        rows.append(
            {
                "task": f"`{task}`",
                "95 % interval from": f"{min(success_rate(found).interval[0] for found in variations):.1%}",
                "replayed": f"{sum(bool(each.replayed) for each in solved)}/{len(solved)}",
                "keyframes found": f"{sum(bool(each.keyframes_found) for each in solved)}/{len(solved)}",
                "largest tip error": f"{worst_tip_error_mm(solved):.1f} mm",
                "placements accepted": f"{len(episodes) / sum(episode.draws for episode in episodes):.0%}",
            }
        )
    return pd.DataFrame(rows)


def paper_table(reports: ExpertReports) -> pd.DataFrame:
    """Variations, items, keyframes, duration and oracle, here and in brackets in the paper."""
    rows = []
    for task in reports.tasks:
        paper, variations = PAPER.get(task, {}), reports.variations(task)
        weights = [len(found) for found in variations]
        solved = [[episode for episode in found if episode.success] for found in variations]
        keyposes = fmean((median(len(each.moves) for each in found) for found in solved), weights)
        duration_s = fmean(map(median_duration_s, solved), weights)
        rows.append(
            {
                "task": f"`{task}`",
                "variations": len(get_task(task).spec.variations),
                "items": f"{movable_items(task)} ({paper.get('items', NOT_MEASURED)})",
                "keyframes": f"{keyposes:.1f} ({paper.get('keyframes', NOT_MEASURED)})",
                "duration": f"{duration_s:.1f} s ({f'{paper["duration_s"]:.1f} s' if paper else NOT_MEASURED})",
                "oracle of the original": f"{paper['oracle']:.0%}" if "oracle" in paper else NOT_MEASURED,
            }
        )
    total = sum(row["variations"] for row in rows)
    rows.append({"task": "all", "variations": total, "oracle of the original": f"{ORIGINAL_ORACLE_MEAN:.1%}"})
    return pd.DataFrame(rows).fillna("")


def load_table(reports: ExpertReports) -> pd.DataFrame:
    """Peak loads in the experts' episodes beside their bounds."""
    rows = [_load_row("*at most*", LoadMetrics(**BOUNDS, penetrating=""), "")]
    for task in reports.tasks:
        exact, rounded = (
            reports.reports[name].load(task) if name in reports.reports else None for name in (EXACT, ROUNDED)
        )
        assert exact is not None  # see ExpertReports.read
        force = NOT_MEASURED if rounded is None else f"{rounded.contact_force_n:.0f} N"
        rows.append(_load_row(f"`{task}`", exact, force))
        if own := get_task(task).spec.load_bounds:
            bounds = LoadMetrics(**BOUNDS | dict(own), penetrating="")
            rows.append(_load_row(f"*at most in `{task}`*", bounds, ""))
    return pd.DataFrame(rows)


def _load_row(name: str, load: LoadMetrics, rounded_force: str) -> dict[str, str]:
    bodies = f" ({load.penetrating})" if load.penetrating else ""
    return {
        "task": name,
        "torque": f"{load.torque:.0%}",
        "at its limit": f"{load.saturated:.1%}",
        "velocity": f"{load.velocity:.0%}",
        "acceleration": f"{load.acceleration:.0%}",
        "jerk": f"{load.jerk:.0%}",
        "force": f"{load.contact_force_n:.0f} N",
        "fingers": f"{load.finger_speed_m_s:.2f} m/s",
        "penetration": f"{load.penetration_mm:.1f} mm{bodies}",
        "force, rounded": rounded_force,
    }


def movable_items(task: str) -> int:
    """Things of the scene that can move by themselves: free objects, and each door, drawer or button."""
    return Scene(get_task(task).spec.props).model.ntree - len(ARMS)


def tasks_page(folder: Path) -> str:
    """The page of all tasks, in all settings of which there is a folder of expert reports in `folder`.

    Raises:
        BimanualError: there is no report of `standard`, or one of the reports is wrong.
    """
    chosen = [name for name in SETTINGS if name == STANDARD or (folder / name).is_dir()]
    reports = {name: ExpertReports.read(folder / name) for name in chosen}
    settings = [
        {
            "name": name,
            "expert": found.reports[EXACT],
            "world": combined_version(found.reports[EXACT].worlds),
            "success": success_table(found),
            "evidence": evidence_table(found),
            "loads": load_table(found),
        }
        for name, found in reports.items()
    ]
    rounded = reports[STANDARD].reports.get(ROUNDED)
    return render(
        "lerobot_env_bimanual.reports",
        "tasks.md",
        folder=folder.as_posix(),
        voxels=rounded.discretise if rounded else NOT_MEASURED,
        settings=settings,
        paper=paper_table(reports[STANDARD]),
    )
