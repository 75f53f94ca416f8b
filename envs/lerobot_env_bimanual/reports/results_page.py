"""Results as one HTML page that needs no other file."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from markupsafe import Markup, escape

from lerobot_bimanual.foreign_text import MAX_MESSAGE, plain
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.pages import render
from lerobot_bimanual.reports.success_figure import success_figure
from lerobot_bimanual.results.episode import Episode, success_rate
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.failures.attribution import Attribution, attribute_failures
from lerobot_env_bimanual.failures.classes import FailureClass
from lerobot_env_bimanual.rendering.failure_video import FailureVideo, failure_video
from lerobot_env_bimanual.reports.failure_figure import failure_figure
from lerobot_env_bimanual.verification.result_files import ResultFile
from lerobot_env_bimanual.workers import WorkerPool


@dataclass(frozen=True)
class Section:
    """What a page says of one file of results.

    Attributes:
        result: the file.
        attributions: why its failed episodes failed, by seed.
        videos: videos of some of its failed episodes.
    """

    result: ResultFile
    attributions: Mapping[int, Attribution]
    videos: Sequence[FailureVideo] = ()

    @property
    def who(self) -> str:
        """Name of the policy, if it is known."""
        return "policy" if self.result.benchmark is None else self.result.benchmark.config.policy

    @cached_property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of the policy and, of a benchmark, of expert and open-loop baseline."""
        row = self.result.benchmark
        return {"policy": success_rate(self.result.record.episodes)} if row is None else row.rates

    @cached_property
    def classes(self) -> Counter[FailureClass]:
        """Number of failed episodes by class of failure."""
        return Counter(one.failure_class for one in self.attributions.values())

    @property
    def facts(self) -> dict[str, str]:
        """How the result came about, by name."""
        record, row = self.result.record, self.result.benchmark
        facts = {"file": self.result.path.name, "world": record.world}
        if row is not None:
            settings = row.config.model_dump(exclude={"training"}) | row.config.training
            made = Markup(f"{len(row.demonstrations.seeds)}, made with {{}}").format(
                _assignments(row.demonstrations.settings)
            )
            facts |= {"configuration": _assignments(settings), "demonstrations": made, "evaluated": row.date}
            facts["checkpoint"] = f"{row.checkpoint_sha256} (SHA-256), after {row.checkpoint_step} steps"
        return facts | {
            "environment": _assignments(record.options),
            "versions": _assignments(record.versions),
        }


def sections_of(results: Sequence[ResultFile], max_videos: int, pool: WorkerPool) -> list[Section]:
    """Find out why episodes failed, and make videos of some of them.

    Args:
        results: of the world at hand.
        max_videos: failed episodes of each result, of different classes first.
        pool: processes that play and draw.

    Raises:
        BimanualError: an episode does not come out as recorded.
    """
    sections = []
    for result in results:
        record = result.record
        failed = {episode.seed: episode for episode in record.episodes if not episode.success}
        section = Section(
            result, {one.seed: one for one in attribute_failures(record, [*failed.values()], pool)}
        )
        shown = [failed[seed] for seed in _of_different_classes(section.attributions)[:max_videos]]
        film = partial(failure_video, record.task, record.options, section.who)
        videos = pool.map(
            film, shown, f"{record.task}: videos", "video", name=partial(_episode_name, record.task)
        )
        sections.append(replace(section, videos=[*videos]))
    return sections


def _episode_name(task: str, episode: Episode) -> str:
    return f"{task}, seed {episode.seed}"


def _of_different_classes(attributions: Mapping[int, Attribution]) -> list[int]:
    """Seeds of failed episodes, in turns of each class of failure."""
    seen: Counter[str] = Counter()
    rank = {}
    for seed, one in attributions.items():
        rank[seed] = seen[one.failure_class], seed
        seen[one.failure_class] += 1
    return sorted(rank, key=rank.__getitem__)


def results_page(sections: Sequence[Section]) -> str:
    """The page, with its figures and videos inside."""
    rows = [section.result.benchmark for section in sections if section.result.benchmark is not None]
    failures: dict[str, list[Attribution]] = {}
    for section in sections:
        failures.setdefault(section.result.name, []).extend(section.attributions.values())
    charts = [success_figure(rows)] if rows else []
    charts += [failure_figure(failures)] if any(failures.values()) else []
    shown = {kind for section in sections for kind in section.classes}
    return render(
        "lerobot_env_bimanual.reports",
        "results.html",
        sections=sections,
        figures=[
            (_inline("image/png", chart.png()), escape(plain(chart.description, MAX_MESSAGE)))
            for chart in charts
        ],
        classes=[kind for kind in FailureClass if kind in shown],
        inline=_inline,
        control_hz=CONTROL_HZ,
    )


def _inline(kind: str, content: bytes) -> Markup:
    return Markup(f"data:{kind};base64,{b64encode(content).decode()}")


def _assignments(values: Mapping[str, object]) -> Markup:
    return Markup(" ").join(f"{plain(name)}={plain(value)}" for name, value in values.items())
