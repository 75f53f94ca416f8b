"""The page of results says what the files say, loads nothing from elsewhere, and takes no word of theirs for markup."""

import re
import shlex
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import av
import pytest
from planted_failures import SEED, expert_keyposes, played, shifted

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.evaluation.record import EvaluationRecord
from lerobot_env_bimanual.audit.blame import Blame, Loser
from lerobot_env_bimanual.audit.failure_class import FailureClass
from lerobot_env_bimanual.audit.result_files import Result
from lerobot_env_bimanual.commands import results_report as verb
from lerobot_env_bimanual.commands.results_report import ResultsReportConfig, results_report
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.pictures.episode_film import EVERY, Film, film_episode
from lerobot_env_bimanual.reports.results_page import Section, film_size, results_page

ROWS = sorted((Path(__file__).parents[2] / "results" / "leaderboard").glob("*.json"))
EVIL = '</td></style></script><script>alert(1)</script><img src=x onerror=alert(2)>"\' onload="alert(3)" {{ 7 * 7 }}'
TAGS = set(
    re.findall(
        r"\w+",
        "html head meta title style body h1 h2 p code a div table thead tbody tr th td img section figure video "
        "figcaption span details summary dl dt dd",
    )
)


class Reader(HTMLParser):
    """Collects what a browser would find in a page."""

    def __init__(self, page: str):
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data):
        self.text += data


def blamed(seed: int, kind: FailureClass = FailureClass.DROPPED, fact: str = "it fell") -> Blame:
    return Blame(seed, 0, kind, fact, 3, 1, Loser.LEFT, (True, False))


def filmed(seed: int, success: bool = False, size: int = 1000) -> Film:
    return Film(seed, success, "front", 1.0, b"m" * size, b"j")


def section_of(path: Path, **changes) -> Section:
    result = Result.read(path)
    failed = [episode.seed for episode in result.record.episodes if not episode.success]
    return Section(result, **({"blames": {seed: blamed(seed) for seed in failed}} | changes))


def worst() -> int:
    """Index of the row with the most failed episodes."""
    return max(range(len(ROWS)), key=lambda index: len(section_of(ROWS[index]).blames))


def assert_closed(reader: Reader) -> None:
    """Nothing is loaded from elsewhere, and nothing runs."""
    assert set(reader.tags) <= TAGS
    for name, value in reader.attributes:
        assert not name.startswith("on")
        assert name not in ("src", "poster") or value.startswith("data:")
        assert name != "href" or value.startswith("#result")


def test_a_page_of_all_committed_rows_holds_every_row_and_episode_and_loads_nothing():
    sections = [section_of(path) for path in ROWS]
    shown = worst()
    sections[shown] = replace(sections[shown], films=[filmed(next(iter(sections[shown].blames)))], left_out=2)
    reader = Reader(results_page(sections))
    assert_closed(reader)
    assert reader.tags["section"] == len(ROWS)
    assert reader.tags["video"] == 1
    assert reader.tags["img"] == 2
    assert "had no room for: 2" in reader.text
    for section in sections:
        row = section.result.row
        for word in (
            row.checkpoint_sha256,
            row.task,
            row.date,
            row.dataset.command,
            section.result.path.name,
        ):
            assert word in reader.text
        assert f"{row.rates['policy'].successes} of {len(row.episodes)}" in reader.text
    # Two tables of all files, each with a heading, and one of the episodes of each.
    episodes = sum(len(section.result.record.episodes) for section in sections)
    assert reader.tags["tr"] == 2 * (1 + len(ROWS)) + len(ROWS) + episodes


def test_no_word_of_a_file_becomes_markup():
    row = Result.read(ROWS[worst()])
    record = row.record
    evil = replace(
        record,
        options=dict.fromkeys(record.options, EVIL) | {EVIL: EVIL, "variation": EVIL},
        versions={EVIL: EVIL},
        episodes=tuple(
            replace(episode, instruction=EVIL, failure=EVIL if episode.failure else "")
            for episode in record.episodes
        ),
    )
    failed = next(episode.seed for episode in record.episodes if not episode.success)
    by_row = replace(
        row,
        path=Path(EVIL.replace("/", "")),
        row=replace(
            row.row,
            flags=row.row.flags | {EVIL: EVIL},
            dataset=replace(row.row.dataset, command=f"{row.row.dataset.command} {shlex.quote(EVIL)}"),
            machine=replace(row.row.machine, gpu=EVIL),
        ),
    )
    blames = {failed: blamed(failed, fact=EVIL)}
    page = results_page(
        [
            Section(
                Result(Path("record.json"), evil, None), blames, films=[replace(filmed(failed), camera=EVIL)]
            ),
            Section(by_row, blames),
        ]
    )
    reader = Reader(page)
    assert_closed(reader)
    assert "alert(1)</script>" not in page
    assert reader.text.count("<script>alert(1)") > len(record.episodes)
    assert "{{ 7 * 7 }}" in reader.text


def test_the_figure_blames_several_policies_of_a_task_apart():
    lost = [section for path in ROWS if (section := section_of(path)).blames]
    tasks = Counter(section.result.record.task for section in lost)
    task = tasks.most_common(1)[0][0]
    sections = [section for section in lost if section.result.record.task == task]
    failed: Counter[str] = Counter()  # of all trainings of a policy
    for section in sections:
        assert section.result.row is not None
        failed[section.result.row.learner] += len(section.blames)
    assert len(failed) > 1
    page = results_page(sections)
    for policy, count in failed.items():
        assert f"{task} {policy}: {count} failed" in page


def test_the_page_forbids_whatever_it_does_not_need():
    page = results_page([section_of(ROWS[0])])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    assert policy.group(1) == "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'"


class MadeUpPool:
    """Films in no time."""

    def __init__(self, size: int):
        self.size = size

    def map(self, _, orders, *names, **further):
        return (filmed(order[3].seed, order[3].success, self.size) for order in orders)


def test_films_are_of_different_failures_first_and_as_many_as_there_is_room_for():
    section = section_of(ROWS[worst()])
    seeds = sorted(section.blames)
    kinds = [FailureClass.DROPPED, FailureClass.DROPPED, FailureClass.COLLISION, FailureClass.OUT_OF_TIME]
    section = replace(
        section, blames={seed: blamed(seed, kind) for seed, kind in zip(seeds, kinds, strict=False)}
    )
    (all_,) = verb._filmed([section], 3, 1e9, MadeUpPool(1000))
    assert [film.seed for film in all_.films if not film.success] == [seeds[0], seeds[2], seeds[3]]
    assert [film.success for film in all_.films] == [False] * 3 + [True]
    room = 2.5 * film_size(filmed(0, size=1000))
    (few,) = verb._filmed([section], 3, room, MadeUpPool(1000))
    assert [film.success for film in few.films] == [False, True]
    assert few.left_out == 2
    (none,) = verb._filmed([section], 0, 1e9, MadeUpPool(1000))
    assert (none.films, none.left_out) == ([], 0)


@pytest.mark.parametrize("flags", [{"films": -1}, {"max_mb": 0.0}, {"max_mb": float("nan")}])
def test_numbers_that_make_no_sense_are_refused(flags, tmp_path):
    with pytest.raises(InvalidChoice, match=next(iter(flags))):
        results_report(ResultsReportConfig(results=ROWS[0], output=tmp_path / "page.html", **flags))


TASK = "lift_ball"
OPTIONS = {"split": "test", "max_keyposes": "25", "control_mode": "auto"}


@pytest.fixture(scope="module")
def episodes() -> tuple[PlayedEpisode, PlayedEpisode]:
    """One that fails, since the left hand stays beside the ball, and one that does not."""
    keyposes = expert_keyposes(TASK)
    failed = played(TASK, shifted(slice(None), 0, -0.15)(keyposes))
    return failed, played(TASK, expert_keyposes(TASK, SEED + 1), SEED + 1)


@pytest.mark.slow
@pytest.mark.sim
def test_the_verb_writes_a_page_with_films_of_a_failure_and_a_success(episodes, tmp_path, capsys):
    assert [episode.success for episode in episodes] == [False, True]
    record = EvaluationRecord(1, TASK, world_version(TASK), OPTIONS, 1, {"numpy": "1"}, episodes)
    record.write(tmp_path / "record.json")
    output = tmp_path / "pages" / "page.html"
    results_report(
        ResultsReportConfig(results=tmp_path / "record.json", output=output, workers=1, max_mb=1.0)
    )
    assert f"{output}: 1 results, 2 films, " in capsys.readouterr().out
    assert output.stat().st_size < 1e6
    reader = Reader(output.read_text())
    assert_closed(reader)
    assert reader.tags["video"] == 2
    assert reader.text.count("success.") == 1


@pytest.mark.slow
@pytest.mark.sim
def test_a_film_is_as_long_as_the_longer_episode_and_of_what_was_recorded_alone(episodes):
    failed, _ = episodes
    film = film_episode(TASK, OPTIONS, failed, "policy")
    with av.open(BytesIO(film.mp4)) as container:
        frames = sum(1 for _ in container.decode(video=0))
    assert frames == -(-failed.ticks // EVERY) + 1
    assert not film.success
    with pytest.raises(BimanualError, match=f"seed {SEED} does not come out as recorded"):
        film_episode(TASK, OPTIONS, replace(failed, end="0" * 64), "policy")
