"""Whatever lies in a file of the benchmark: a result or one clear line that names the file, and nothing half done."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from drawn_damage import JSON_VALUES, check_clear, damaged_json, mangled
from hypothesis import given
from hypothesis import strategies as st
from made_up_ladders import CERTIFICATE as CERTIFICATE_OF_RUNGS
from made_up_ladders import LADDER
from made_up_rows import ROW
from rich.console import Console

from lerobot_bimanual.benchmark.measurements import read_certificate, read_evaluation, read_worlds
from lerobot_bimanual.benchmark.pipeline import Command, Pipeline
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import parse_json, read_json
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.ladder.rung_certificate import RungCertificate
from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_rows
from lerobot_bimanual.results.statistics import SuccessRate

pytestmark = pytest.mark.fuzz

EVALUATION = {"per_task": [{"metrics": {"successes": [True, False]}}]}
EPISODE = {"task": "lift_ball", "variation": 0, "success": True, "failure": "", "state_hash": "00"}
CERTIFICATE = {
    "control": "expert",
    "discretise": 0,
    "split": "test",
    "worlds": {"lift_ball": "00"},
    "episodes": [EPISODE | {"seed": seed} for seed in (0, 1)],
}
MARKER = {"command": "true", "inputs": {}, "done": True, "seconds": 1.5}
READERS = {
    "evaluation": (EVALUATION, lambda path: read_evaluation(path, [0, 1])),
    "certificate": (CERTIFICATE, lambda path: read_certificate(path, "expert", "lift_ball", [0, 1])),
    "worlds": (CERTIFICATE, read_worlds),
    "row": (json.loads(ROW.to_json()), ResultRow.read),
    "ladder": (asdict(LADDER), LadderResult.read),
    "certificate of rungs": (asdict(CERTIFICATE_OF_RUNGS), RungCertificate.read),
    "any JSON": (MARKER, read_json),
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drawn") / "drawn.json"


@pytest.mark.parametrize("reader", READERS)
@given(data=st.data())
def test_every_reader_reads_or_names_the_file_on_one_line(reader, data, place):
    content, read = READERS[reader]
    place.write_bytes(data.draw(damaged_json(content)))
    try:
        read(place)
    except BimanualError as error:
        check_clear(error, "drawn.json")


@given(text=st.binary() | st.text() | JSON_VALUES.map(json.dumps) | mangled(json.dumps(MARKER).encode()))
def test_what_is_parsed_can_be_written_and_parsed_again(text):
    try:
        value = parse_json(text)
    except BimanualError:
        return
    again = json.dumps(value, allow_nan=False, ensure_ascii=False).encode()
    assert parse_json(again) == value


@given(value=JSON_VALUES)
def test_what_is_decoded_is_what_was_asked_for(value):
    for kind in (SuccessRate, ResultRow):
        try:
            assert isinstance(decode(kind, value, "drawn"), kind)
        except BimanualError as error:
            check_clear(error)
    assert decode(SuccessRate, asdict(SuccessRate(1, 2)), "drawn") == SuccessRate(1, 2)


@given(data=st.data())
def test_a_leaderboard_is_a_whole_page_or_an_error(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rows")
    (folder / ROW.file_name).write_bytes(data.draw(damaged_json(json.loads(ROW.to_json()))))
    try:
        page = benchmark_page(read_rows(folder), folder)
    except BimanualError as error:
        check_clear(error, str(folder))
    else:
        assert page.endswith(
            "compares every state and claim.\n"
        )  # its policy is not installed: no command follows


@given(data=st.data())
def test_a_marker_is_believed_or_named(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("markers")
    called: list[list[str]] = []

    def call(words: list[str]) -> int:
        called.append(words)
        return 0

    (folder / "drawn.command.json").write_bytes(data.draw(damaged_json(MARKER)))
    pipeline, command = Pipeline(folder, Console(quiet=True), call), Command("drawn", ["true"])
    try:
        pipeline.run(command)
    except BimanualError as error:
        check_clear(error, "drawn.command.json")
        done = False
    else:
        done = pipeline.seconds(command) >= 0
    assert len(called) <= done
