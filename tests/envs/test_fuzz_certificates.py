"""Whatever lies in a certificate or a log, and whatever is typed for seeds, sizes and variations: no other exception."""

import json
from pathlib import Path

import pytest
from drawn_damage import JSON_VALUES, check_clear, damaged_json, mangled
from hypothesis import given
from hypothesis import strategies as st

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.statistics import wilson_interval
from lerobot_env_bimanual.commands.report import ReportConfig, report
from lerobot_env_bimanual.expert import outcome_log
from lerobot_env_bimanual.expert.outcome import Job, MoveReport, Outcome
from lerobot_env_bimanual.expert.outcome_log import OutcomeLog
from lerobot_env_bimanual.expert.seed_range import parse_seeds
from lerobot_env_bimanual.expert.stored_certificate import StoredCertificate
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks, resolve_tasks

pytestmark = pytest.mark.fuzz

COMMITTED = Path(__file__).parents[2] / "results" / "certificates"
SEEDS = range(61000, 61002)
JOB = Job("lift_ball", "0", "test", 0, "noop")
OUTCOME = Outcome(
    "lift_ball", 0, "test", 0, False, "fell", "lift", ("up",), (MoveReport("lift", (0.5,), 9, (0.0, 1.0), True),), 9, 1,
    0, False, "00",
)  # fmt: skip


@pytest.fixture(scope="module")
def certificate() -> dict:
    """That of the control which holds still, cut down to one task and two seeds."""
    content = json.loads((COMMITTED / "noop.json").read_text())
    content["episodes"] = [
        episode
        for episode in content["episodes"]
        if episode["task"] == "lift_ball" and episode["seed"] in SEEDS
    ]
    interval = wilson_interval(0, len(SEEDS))
    rate = {"task": "lift_ball", "variation": 0, "successes": 0, "trials": len(SEEDS), "wilson_95": interval}
    worlds = {"lift_ball": content["worlds"]["lift_ball"]}
    return content | {"seeds": f"{SEEDS.start}:{SEEDS.stop}", "worlds": worlds, "rates": [rate]}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drawn") / "drawn.json"


def test_the_certificate_is_good_before_it_is_damaged(certificate, place):
    place.write_text(json.dumps(certificate))
    assert len(StoredCertificate.read(place).episodes) == len(SEEDS)


@given(data=st.data())
def test_a_certificate_is_true_of_itself_or_named_on_one_line(data, certificate, place):
    place.write_bytes(data.draw(damaged_json(certificate)))
    try:
        stored = StoredCertificate.read(place)
    except BimanualError as error:
        check_clear(error, "drawn.json")
    else:
        assert [row | {"coupling": None} for row in stored.rates] == [
            row | {"coupling": None} for row in stored.campaign.rate_rows()
        ]


@given(data=st.data())
def test_no_page_is_written_from_one_damaged_certificate(data, certificate, tmp_path_factory):
    folder = tmp_path_factory.mktemp("certificates")
    (folder / "expert.json").write_bytes(data.draw(damaged_json(certificate)))
    with pytest.raises(BimanualError, match=r"expert\.json"):  # for it is one of a control
        report(ReportConfig(certificates=folder, output=folder / "page.md"))
    assert [path.name for path in folder.iterdir()] == ["expert.json"]


@given(data=st.data())
def test_a_log_gives_what_was_noted_or_is_named_and_kept(data, place, monkeypatch_module):
    path = place.with_name("log.jsonl")
    path.unlink(missing_ok=True)
    OutcomeLog(path).add(JOB, OUTCOME)
    header, line, _ = path.read_bytes().split(b"\n")
    damaged = data.draw(damaged_json(json.loads(line)) | mangled(line))
    content = (
        header
        + b"\n"
        + data.draw(st.sampled_from([damaged, damaged + b"\n", damaged + b"\n" + line + b"\n"]))
    )
    path.write_bytes(content)
    try:
        found = OutcomeLog(path).get(JOB)
    except BimanualError as error:
        check_clear(error, "log.jsonl, line ")
        left = content
    else:
        assert found is None or isinstance(found, Outcome)
        left = path.read_bytes()
    assert left == path.read_bytes()
    assert left.startswith(header + b"\n")


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            outcome_log, "_source_digest", lambda: "same"
        )  # hashing all sources takes most of the time
        yield patch


TEXTS = st.text(max_size=30) | st.sampled_from(
    ["0:", ":1", "1:0", "0:²", "-1:2", "0:" + "9" * 5000, "0 : 1", "٣:٤"]
)


@given(text=TEXTS | st.from_regex(r"\d{1,12}:\d{1,12}", fullmatch=True))
def test_seeds_are_a_range_or_refused(text):
    try:
        seeds = parse_seeds(text)
    except BimanualError as error:
        check_clear(error)
    else:
        first, end = map(int, text.split(":"))
        assert (seeds.start, seeds.stop) == (first, end)
        assert len(seeds) > 0


@given(value=TEXTS | JSON_VALUES | st.from_regex(r"\d{1,6}x?\d{0,6}", fullmatch=True))
def test_an_image_size_is_two_sides_or_refused(value):
    try:
        height, width = EnvOptions(image_size=value).size
    except BimanualError:
        return
    assert 8 <= min(height, width) <= max(height, width) <= 4096


@pytest.mark.parametrize("task", list_tasks())
@given(value=TEXTS | JSON_VALUES | st.sampled_from(["٣", "²", "9" * 5000, "any"]))
def test_a_variation_is_one_of_the_task_or_refused(task, value):
    spec = get_task(task).spec
    try:
        index = spec.variation_index(value)
    except BimanualError:
        return
    assert index is None or 0 <= index < len(spec.variations)


@given(text=TEXTS | st.lists(st.sampled_from([*list_tasks(), "all", "two_armed", "", "x"])).map(",".join))
def test_a_selection_is_of_tasks_or_refused(text):
    try:
        assert set(resolve_tasks(text)) <= set(list_tasks())
    except BimanualError as error:
        check_clear(error, "Tasks and suites")
