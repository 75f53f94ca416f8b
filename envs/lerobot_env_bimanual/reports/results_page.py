"""Results as one page of HTML that needs nothing but itself."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from jinja2 import Environment, PackageLoader, StrictUndefined

from lerobot_bimanual.benchmark.episode_result import success_rate
from lerobot_bimanual.benchmark.names import perturbed, place_name
from lerobot_bimanual.benchmark.success_figure import success_figure
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.audit.blame import Blame
from lerobot_env_bimanual.audit.failure_class import FailureClass
from lerobot_env_bimanual.audit.result_files import Result
from lerobot_env_bimanual.audit.result_names import result_names
from lerobot_env_bimanual.pictures.blame_bars import blame_bars
from lerobot_env_bimanual.pictures.episode_film import Film

TEMPLATE = "results_page.html"
"""Beside this file. Jinja escapes whatever it puts in: names and sentences come from anybody's files."""


@dataclass(frozen=True)
class Section:
    """What a page says of one file of results.

    Attributes:
        result: the file.
        blames: why its failed episodes failed, by seed.
        films: of some of its episodes.
        left_out: films that the page had no room for.
    """

    result: Result
    blames: Mapping[int, Blame]
    films: Sequence[Film] = ()
    left_out: int = 0

    @property
    def who(self) -> str:
        """Name of the policy, as far as it is known."""
        return "policy" if self.result.row is None else self.result.row.policy

    @property
    def place(self) -> str:
        """The task, or one of its variations, or the task in a perturbed world."""
        record = self.result.record
        return perturbed(place_name(record.task, record.options.get("variation", "any")), record.perturb)

    @cached_property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of the policy and, in a row, of expert and blind control."""
        row = self.result.row
        return {"policy": success_rate(self.result.record.episodes)} if row is None else row.rates

    @cached_property
    def classes(self) -> Counter[FailureClass]:
        """How many episodes failed in which way."""
        return Counter(blame.failure_class for blame in self.blames.values())

    @property
    def facts(self) -> dict[str, str]:
        """What is known of how the result came about, by name."""
        record, row = self.result.record, self.result.row
        facts = {"file": self.result.path.name, "world": record.world}
        if row is not None:
            machine = row.machine.gpu or f"{row.machine.cpus} cores"
            facts |= {
                "checkpoint": f"{row.checkpoint_sha256} (SHA-256), after {row.checkpoint_step} steps",
                "chosen on val": "; ".join(
                    f"{success_rate(one.episodes).successes} of {len(one.episodes)} after {one.step} steps"
                    for one in row.validation
                )
                or "the only checkpoint, not validated",
                "training": f"{row.training_seconds / 60:.1f} minutes on {machine}",
                "demonstrations": f"{len(row.dataset.seeds)}, made by {row.dataset.command}",
                "flags of the training": _assignments(row.flags),
                "evaluated": row.date,
            }
            if row.stopped_against is not None:
                facts["stopped"] = (
                    f"as soon as it differed from the checkpoint {row.stopped_against}; its rate is biased"
                )
        return facts | {
            "environment": _assignments(record.options),
            "side by side": f"{record.batch_size} environments",
            "versions": ", ".join(f"{name} {version}" for name, version in sorted(record.versions.items())),
        }

    def episode(self, seed: int) -> PlayedEpisode:
        """The episode of a seed."""
        return next(episode for episode in self.result.record.episodes if episode.seed == seed)


def results_page(sections: Sequence[Section]) -> str:
    """The page, with its figures and films inside."""
    rows = [section.result.row for section in sections if section.result.row is not None]
    names = result_names([section.result for section in sections])
    blames: dict[str, list[Blame]] = {}
    for section in sections:
        blames.setdefault(names[section.result.path], []).extend(section.blames.values())
    figures = [
        *([success_figure(rows)] if rows else []),
        *([blame_bars(blames)] if any(blames.values()) else []),
    ]
    shown = {kind for section in sections for kind in section.classes}
    environment = Environment(
        loader=PackageLoader("lerobot_env_bimanual", "reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(TEMPLATE).render(
        sections=sections,
        figures=[(_inline("image/png", figure.png()), figure.description) for figure in figures],
        classes=[kind for kind in FailureClass if kind in shown],
        inline=_inline,
        control_hz=CONTROL_HZ,
    )


def film_size(film: Film) -> int:
    """Bytes that a film adds to a page, and some for the words around it."""
    return len(_inline("video/mp4", film.mp4)) + len(_inline("image/jpeg", film.poster)) + 1000


def _inline(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode()}"


def _assignments(values: Mapping[str, str]) -> str:
    return " ".join(f"{name}={value}" for name, value in values.items())
