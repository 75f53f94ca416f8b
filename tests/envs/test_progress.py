"""The bar of `generate` tells what is there, how fast it goes, and how long it will take."""

import io
import re

from lerobot_env_bimanual.generation.progress import Progress


def last_line(file: io.StringIO) -> str:
    return file.getvalue().split("\r")[-1]


def test_the_bar_shows_episodes_rate_and_time_to_go() -> None:
    file = io.StringIO()
    with Progress(8, file) as progress:
        progress.start_from(0, successes=0)
        progress.show(2)
        assert re.search(r" 2/8 \[\d+:\d+<\d+:\d+,.* [1-9]\d* demos/h\]", last_line(file))


def test_episodes_of_earlier_runs_count_but_say_nothing_about_the_rate() -> None:
    file = io.StringIO()
    with Progress(8, file) as progress:
        progress.start_from(6, successes=0)
        assert " 6/8 " in last_line(file)
        assert "<?" in last_line(file)
        assert " 0 demos/h" in last_line(file)
        progress.show(1)
        assert " 7/8 " in last_line(file)


def test_a_damaged_shard_takes_its_episodes_back() -> None:
    file = io.StringIO()
    with Progress(8, file) as progress:
        progress.start_from(4, successes=0)
        progress.show(4)
        progress.start_from(6, successes=4)
        assert " 6/8 " in last_line(file)
        progress.show(6)
        assert " 8/8 " in last_line(file)
