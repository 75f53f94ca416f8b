"""Pages and lines on a terminal show any text of a file as plain text, whatever it contains."""

import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel
from sample_results import EXPERT, RESULT, provenance, variant
from sample_robustness import EXPERT_REPORT, ROBUSTNESS

import lerobot_bimanual.benchmark.pipeline  # defines records
import lerobot_bimanual.dataset.reader  # noqa: F401
from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, Provenance
from lerobot_bimanual.errors import MAX_TEXT, BimanualError
from lerobot_bimanual.pages import escape_markdown
from lerobot_bimanual.reports.benchmark_page import benchmark_page
from lerobot_bimanual.reports.robustness import expert_robustness_page, print_robustness
from lerobot_bimanual.results.benchmark import Machine
from lerobot_bimanual.results.record import Record
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.reports import expert_tables

EVIL = "<script>a</script> x`|\n# Injected\r\n[l](javascript:a) \x1b[2J\x9b{: onclick=a }\u202e`<img src=x onerror=a>"
HOSTILE = (EVIL, f"y`{EVIL}`y", "A" * 10**6)
TRAINED = variant(
    config={"device": "cpu", "evaluation": {"env.episode_length": "9"}},
    machine=Machine(cpus=2, gpu="H100", instructions="AVX512"),
)
RECORDS = (TRAINED, ROBUSTNESS, EXPERT_REPORT, EXPERT, provenance())
UNPRINTED = {"Marker", "_Info", "_Feature", "Calibration"}
"""Records whose texts are compared and never printed."""


def check_plain(text: str) -> None:
    assert not {character for character in text if not character.isprintable()} - {"\n"}
    assert "A" * (MAX_TEXT + 1) not in text


def check_harmless(page: str) -> None:
    check_plain(page)
    page = re.sub(r"\n```bash\n[^\n`]*\n```\n", "", page)  # a line of code is one
    for danger in ("<script", "<img", "](javascript", "\n# Injected", "{: on"):
        assert danger not in page


def texts(value: Any, owner: str, *path: Any) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Owner (class and field) and place in the JSON of one text of each kind in a record."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from texts(getattr(value, name), f"{type(value).__name__}.{name}", *path, name)
    elif isinstance(value, str):
        yield owner, path
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield f"{owner} keys", (*path, {"key": key})
            yield from texts(item, owner, *path, key)
    elif isinstance(value, tuple | list):
        for index, item in enumerate(value):
            yield from texts(item, owner, *path, index)


def with_text(record: Record, path: tuple[Any, ...], text: str) -> str:
    """The JSON of a record with another text at one place."""
    whole = record.model_dump(mode="json")
    place: Any = whole
    for step in path[:-1]:
        place = place[step]
    if isinstance(path[-1], dict):
        place[text] = place.pop(path[-1]["key"])
    else:
        place[path[-1]] = text
    return json.dumps(whole)


@pytest.fixture
def show(datasets, tmp_path, capsys, monkeypatch) -> dict[type[Record], Callable[[Any], str]]:
    """What is written about a record of each kind."""

    def card(record: Any) -> str:
        root = tmp_path / "dataset"
        if not root.is_dir():
            shutil.copytree(datasets["frames"], root)
        record.write(root / PROVENANCE_FILE)
        write_card(root, "me/it")
        return (root / "README.md").read_text()

    def robustness(record: Any) -> str:
        print_robustness(record)
        return capsys.readouterr().out

    def experts(record: Any) -> str:
        monkeypatch.setattr(expert_tables, "movable_items", lambda _: 1)  # which compiles a model
        record.write(tmp_path / "experts/standard/expert.json")
        return expert_tables.tasks_page(tmp_path / "experts")

    return {
        type(RESULT): lambda record: benchmark_page({Path("a.json"): record}, Path(EVIL)),
        type(ROBUSTNESS): robustness,
        type(EXPERT_REPORT): lambda record: expert_robustness_page({record.task: record}),
        type(EXPERT): experts,
        Provenance: card,
    }


@pytest.mark.parametrize("record", RECORDS, ids=lambda each: type(each).__name__)
def test_hostile_text_in_any_field_of_a_record_is_refused_or_written_as_text(record, show, install_recipe):
    install_recipe("mine")
    pages = 0
    for path in dict(texts(record, "")).values():
        for text in HOSTILE:
            try:
                check_harmless(show[type(record)](type(record).from_json(with_text(record, path, text))))
                pages += 1
            except BimanualError as error:
                check_plain(str(error))
    assert pages


def test_no_record_with_texts_is_left_out():
    def below(kind: type[Record]) -> set[type[Record]]:
        found = set(kind.__subclasses__())
        return found.union(*map(below, found))

    fields = {
        f"{kind.__name__}.{name}"
        for kind in below(Record)
        if kind.__module__.startswith("lerobot_bimanual.")
        and not kind.__subclasses__()
        and kind.__name__ not in UNPRINTED
        for name, field in kind.model_fields.items()
        if "str" in str(field.annotation).lower() and "lerobot_bimanual" not in str(field.annotation)
    }
    covered = {
        owner.removesuffix(" keys")
        for record in (*RECORDS, RESULT.evaluation.model_copy(update={"policy": {"type": "a"}}))
        for owner, _ in texts(record, "")
    }
    missing = fields - covered
    assert not missing


def test_code_and_emphasis_stay_and_all_else_is_text_in_markdown():
    assert escape_markdown("`camera_moved` **12** 95 % ± 1") == "`camera_moved` **12** 95 % ± 1"
    assert escape_markdown("a|b <c> [d](e)") == "a&#124;b &#60;c&#62; &#91;d&#93;(e)"
    assert escape_markdown("`a<b`") == "&#96;a&#60;b&#96;"


def test_the_next_command_is_one_plain_line(capsys: pytest.CaptureFixture[str]) -> None:
    show_next("lerobot-bimanual", "dataset", "push", f"--repo_id={EVIL}")
    said = capsys.readouterr().err
    check_plain(said)
    assert said.count("\n") == 1
