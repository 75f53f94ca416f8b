"""The HTML page of results says what the files say, loads nothing from elsewhere, and takes no word of theirs for markup."""

from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import av
import pytest
from planted_failures import SEED, evaluation, expert_keyposes, played, reproved, shifted

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.results_report import ResultsReportConfig, results_report
from lerobot_env_bimanual.failures.attribution import Attribution, Responsible
from lerobot_env_bimanual.failures.classes import FailureClass
from lerobot_env_bimanual.rendering.failure_video import EVERY, FailureVideo, failure_video
from lerobot_env_bimanual.reports.results_page import Section, results_page
from lerobot_env_bimanual.verification.result_files import ResultFile

ROWS = sorted((Path(__file__).parents[2] / "results" / "leaderboard").glob("*.json"))
EVIL = '</td></style></script><script>alert(1)</script><img src=x onerror=alert(2)>"\' onload="alert(3)" {{ 7 * 7 }}'
TASK = "lift_ball"
OPTIONS = {"split": "test", "max_keyposes": 25, "control_mode": "auto"}


class Reader(HTMLParser):
    """Collects what a browser would find in a page."""

    def __init__(self, page: str):
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.text = ""
        self.feed(page)
        assert not self.tags.keys() & {"script", "iframe", "object", "embed", "form", "base"}

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        for name, value in attrs:
            assert not name.startswith("on")
            assert name not in ("src", "poster") or value.startswith("data:")
            assert name != "href" or value.startswith("#result")

    def handle_data(self, data):
        self.text += data


def section_of(path: Path, fact: str = "it fell") -> Section:
    result = ResultFile.read(path)
    failed = [episode.seed for episode in result.record.episodes if not episode.success]
    failures = {
        seed: Attribution(seed, 0, FailureClass.DROPPED, fact, 3, 1, Responsible.LEFT, (True, False))
        for seed in failed
    }
    return Section(result, failures)


def test_a_page_of_all_committed_results_holds_every_result_and_episode():
    sections = [section_of(path) for path in ROWS]
    shown = next(index for index, section in enumerate(sections) if section.attributions)
    video = FailureVideo(next(iter(sections[shown].attributions)), "front", 1.0, b"m" * 1000, b"j")
    sections[shown] = replace(sections[shown], videos=[video])
    page = results_page(sections)
    reader = Reader(page)
    assert "content=\"default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'\"" in page
    assert (reader.tags["section"], reader.tags["video"], reader.tags["img"]) == (len(ROWS), 1, 2)
    for section in sections:
        row = section.result.benchmark
        assert row.checkpoint_sha256 in reader.text
        assert f"{row.rates['policy'].successes} of {len(row.episodes)}" in reader.text
    # Two tables of all files, each with a heading, and one of the episodes of each.
    episodes = sum(len(section.result.record.episodes) for section in sections)
    assert reader.tags["tr"] == 2 * (1 + len(ROWS)) + len(ROWS) + episodes


def test_no_word_of_a_file_becomes_markup():
    section = next(section for path in ROWS if (section := section_of(path, EVIL)).attributions)
    record = section.result.record
    evil = record.model_copy(
        update={
            "options": dict.fromkeys(record.options, EVIL) | {EVIL: EVIL, "variation": EVIL},
            "versions": {EVIL: EVIL},
            "episodes": tuple(
                reproved(episode, instruction=EVIL).model_copy(
                    update={"failure": EVIL if episode.failure else None}
                )
                for episode in record.episodes
            ),
        }
    )
    page = results_page([replace(section, result=ResultFile(Path("record.json"), evil, None))])
    reader = Reader(page)
    assert reader.text.count("<script>alert(1)") > len(record.episodes)
    assert "{{ 7 * 7 }}" in reader.text


@pytest.mark.slow
@pytest.mark.sim
def test_the_command_writes_a_page_with_a_video_of_a_failure_beside_the_expert(tmp_path, capsys):
    failed = played(TASK, shifted(slice(None), 0, -0.15)(expert_keyposes(TASK)))
    episodes = (failed, played(TASK, expert_keyposes(TASK, seed=SEED + 1), SEED + 1))
    assert [episode.success for episode in episodes] == [False, True]
    record = evaluation(TASK, OPTIONS, *episodes)
    record.write(tmp_path / "record.json")
    output = tmp_path / "pages" / "page.html"
    config = ResultsReportConfig(results=tmp_path / "record.json", format="html", output=output, workers=1)
    results_report(config)
    assert f"{output}: 1 results, 1 videos, " in capsys.readouterr().out
    assert Reader(output.read_text()).tags["video"] == 1

    video = failure_video(TASK, OPTIONS, "policy", failed)
    with av.open(BytesIO(video.mp4)) as container:
        frames = sum(1 for _ in container.decode(video=0))
    assert frames == -(-(failed.ticks or 0) // EVERY) + 1
    with pytest.raises(BimanualError, match=f"seed {SEED} replays otherwise than recorded"):
        failure_video(TASK, OPTIONS, "policy", reproved(failed, end="0" * 64))
