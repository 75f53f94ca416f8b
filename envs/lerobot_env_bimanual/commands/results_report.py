"""The verb `report-results`: one page to read, with films of what failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import InvalidChoice, check_range

if TYPE_CHECKING:
    from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
    from lerobot_env_bimanual.pictures.episode_film import Film
    from lerobot_env_bimanual.reports.results_page import Section
    from lerobot_env_bimanual.workers import WorkerPool

type FilmOrder = tuple[int, str, dict[str, str], PlayedEpisode, str]
"""Index of the section, task, options, episode and name of the policy."""


@dataclass
class ResultsReportConfig:
    """Options of the verb `report-results`."""

    # A file, or a folder of files: rows of `benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    output: Path = Path("outputs/results.html")  # the page, one file that opens without network
    # Failed episodes filmed of each result, of different kinds first, and beside them one success; 0 films none.
    films: int = 3
    max_mb: float = 10.0  # films that would make the page larger are left out
    workers: int = 0  # processes; 0 takes one per core


def results_report(config: ResultsReportConfig) -> None:
    """Write one HTML page of results, with figures and with films of failed episodes beside the expert's.

    Of every file: success with its interval, how the checkpoint was trained and chosen, every episode, and of the failed
    ones why they failed and who lost them, as `blame` finds it. Films are replays from the recorded actions, compared state
    by state; no weights are needed. The page holds its figures and films itself and loads nothing from elsewhere.

    Examples:
        lerobot-bimanual results report --results=results/leaderboard
        lerobot-bimanual results report --results=outputs/eval/lift_ball_test_record.json --output=lift_ball.html
        lerobot-bimanual results report --results=results/leaderboard --films=10 --max_mb=50
    """
    from lerobot_bimanual.benchmark.likeness import check_likeness
    from lerobot_bimanual.output_file import check_output_file, write_file
    from lerobot_env_bimanual.audit.blaming import blames_of
    from lerobot_env_bimanual.audit.result_files import Result, result_files
    from lerobot_env_bimanual.reports.results_page import Section, results_page
    from lerobot_env_bimanual.workers import WorkerPool

    check_range("films", config.films, 0)
    if not config.max_mb > 0:
        raise InvalidChoice("max_mb", config.max_mb, "a number of megabytes above 0")
    check_output_file(config.output)
    results = [Result.read(path) for path in result_files(config.results)]
    for result in results:
        result.check_world()
    check_likeness({result.path: result.row for result in results if result.row is not None})
    with WorkerPool(config.workers) as pool:
        sections = []
        for result in results:
            failed = [episode for episode in result.record.episodes if not episode.success]
            blames = blames_of(result.record, failed, pool) if failed else []
            sections.append(Section(result, {blame.seed: blame for blame in blames}))
        room = config.max_mb * 1e6 - len(results_page(sections).encode())
        sections = _filmed(sections, config.films, room, pool)
    page = results_page(sections)
    write_file(config.output, page)
    count, left_out = (
        sum(counts) for counts in zip(*((len(s.films), s.left_out) for s in sections), strict=True)
    )
    print(f"{config.output}: {len(results)} results, {count} films, {len(page.encode()) / 1e6:.1f} MB")
    if left_out:
        print(f"{left_out} films had no room; a larger --max_mb takes them in")


def _filmed(sections: Sequence[Section], films: int, room: float, pool: WorkerPool) -> list[Section]:
    """The sections with films, as many as there is room for; each section's first ones come first."""
    from dataclasses import replace

    from lerobot_env_bimanual.reports.results_page import film_size

    orders = [order for _, order in sorted(_orders(sections, films), key=lambda ranked: ranked[0])]
    taken: list[list[Film]] = [[] for _ in sections]
    left_out: Counter[int] = Counter()
    if orders:
        made = pool.map(
            _film, orders, "films", "film", name=lambda order: f"{order[1]}, seed {order[3].seed}"
        )
        for order, film in zip(orders, made, strict=True):
            room -= film_size(film)
            if room < 0:
                room += film_size(film)
                left_out[order[0]] += 1
            else:
                taken[order[0]].append(film)
    return [
        replace(section, films=sorted(taken[index], key=lambda film: film.success), left_out=left_out[index])
        for index, section in enumerate(sections)
    ]


def _orders(sections: Sequence[Section], films: int) -> Iterator[tuple[tuple[float, int], FilmOrder]]:
    """Films to make, each with its rank: one failure of every section, then one success, then further failures."""
    for index, section in enumerate(sections):
        record = section.result.record
        solved = [episode for episode in record.episodes if episode.success][: min(1, films)]
        ranked = [*enumerate(_of_different_kinds(section)[:films]), *((0.5, episode) for episode in solved)]
        for rank, episode in ranked:
            yield (rank, index), (index, record.task, record.options, episode, section.who)


def _of_different_kinds(section: Section) -> list[PlayedEpisode]:
    """Failed episodes, in turns of each class of failure."""
    seen: Counter[str] = Counter()
    ranked = []
    for seed, blame in section.blames.items():
        ranked.append((seen[blame.failure_class], seed))
        seen[blame.failure_class] += 1
    return [section.episode(seed) for _, seed in sorted(ranked)]


def _film(order: FilmOrder) -> Film:
    from lerobot_env_bimanual.pictures.episode_film import film_episode

    _, task, options, episode, who = order
    return film_episode(task, options, episode, who)
