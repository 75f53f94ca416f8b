"""Results of benchmarks: they survive a file, bad ones are refused, and they stand side by side."""

import json
from dataclasses import replace
from typing import Any

import pytest
from made_up_rows import ROW, generation

from lerobot_bimanual.benchmark.results import (
    BadResult,
    ResultRow,
)


def test_a_row_survives_json():
    text = ROW.to_json()
    assert ResultRow.from_json(text) == ROW
    assert ResultRow.from_json(text).to_json() == text


def test_where_one_checkpoint_left_nothing_to_choose_the_last_one_was_tested():
    row = replace(ROW, validation=(), flags=ROW.flags | {"save_freq": "4"})
    assert ResultRow.from_json(row.to_json()) == row
    with pytest.raises(ValueError, match="'checkpoint_step' is 2, but the best on val is that after 4 steps"):
        replace(row, checkpoint_step=2)
    with pytest.raises(ValueError, match=r"'validation'.*must be of every checkpoint: 2 of them"):
        replace(ROW, validation=())


def test_the_file_shows_success_rates_to_readers():
    rates = json.loads(ROW.to_json())["rates"]
    assert (rates["policy"]["successes"], rates["policy"]["trials"]) == (2, 4)
    assert rates["policy"]["wilson_95"] == pytest.approx([0.150, 0.850], abs=1e-3)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (["schema_version"], 1, "schema_version"),
        (["task"], 3, r"result\.task is 3, but must be a str"),
        (["variation"], 0, r"result\.variation"),
        (["policy"], None, r"result\.policy"),
        (["recipe"], [], r"result\.recipe"),
        (["flags"], {"steps": 4}, r"result\.flags\.steps"),
        (["flags"], {"steps": "4"}, "'flags'.*must hold the numbers steps, batch_size, save_freq, seed"),
        (["dataset"], "here", r"result\.dataset"),
        (["dataset", "command"], 1, r"result\.dataset\.command"),
        (["dataset", "seeds"], [0, 1.5], r"result\.dataset\.seeds\[1\]"),
        (["dataset", "versions"], [], r"result\.dataset\.versions"),
        (["checkpoint_step"], 2, r"'checkpoint_step' is 2, but the best on val is that after 4 steps"),
        (["validation", 1, "step"], 3, "'validation'.*must be of every checkpoint"),
        (["validation", 1, "episodes", 0, "seed"], 7, "'validation'.*on the same seeds from 0 on"),
        (["flags", "save_freq"], "0", "'flags'.*must be at least 1"),
        (["flags", "steps"], "9" * 5000, "'flags'.*must hold the numbers"),
        (["flags", "policy.type"], "other", "'flags'.*policy.type must be 'mine' and not 'other'"),
        (["dataset", "seeds"], [1, 0], "'dataset'.*must be there and rise"),
        (["dataset", "command"], generation("push_box"), "dataset.repo_id must be 'benchmark/push_box'"),
        (["dataset", "image_size"], 64, "--image_size of its command must be '64x64' and not '128x128'"),
        (["versions", "mujoco"], "4", "'versions'.*mujoco must be that of the dataset, '3', and not '4'"),
        (["machine", "gpu"], "a|b", "'machine'"),
        (["world"], "here", "'world' is 'here', but must be 12 hex digits"),
        (["checkpoint_sha256"], "abc", "'checkpoint_sha256' is 'abc', but must be 64 hex digits"),
        (["validation"], {}, r"result\.validation"),
        (["validation", 0, "step"], True, r"result\.validation\[0\]\.step"),
        (["split"], "train", "'split' is 'train', but must be test"),
        (["episodes"], [], "'episodes'.*must not be empty"),
        (["episodes", 1, "seed"], 0, "'episodes'.*nor repeat or leave out a seed"),
        (["expert", 1, "seed"], 9, "'expert'.*must be on the seeds of the policy"),
        (["expert", 1, "failure"], "fell", "'expert'.*a failure just if"),
        (["blind"], [], "'blind'.*must be on the seeds of the policy"),
        (["blind", 1, "variation"], 3, "'blind'.*each once per variation"),
        (["episodes", 1, "success"], 1, r"result\.episodes\[1\]\.success is 1, but must be a bool"),
        (["expert", 0, "failure"], 5, r"result\.expert\[0\]\.failure"),
        (["blind", 0, "variation"], "0", r"result\.blind\[0\]\.variation"),
        (["blind", 0, "state_hash"], 0, r"result\.blind\[0\]\.state_hash"),
        (["training_seconds"], -1.0, "training_seconds"),
        (["machine", "cpus"], 1.5, r"result\.machine\.cpus"),
        (["machine", "gpu"], 1, r"result\.machine\.gpu"),
        (["versions", "mujoco"], 3, r"result\.versions\.mujoco"),
        (["date"], "yesterday", "'date' is 'yesterday', but must be a day"),
        (["rates", "policy", "successes"], 4, "'rates'.*but the episodes give"),
        (["remark"], "well done", "result has unknown remark"),
    ],
)
def test_a_bad_field_is_named(place: list[Any], value: Any, message: str):
    content = json.loads(ROW.to_json())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    with pytest.raises(BadResult, match=message):
        ResultRow.from_json(json.dumps(content))


@pytest.mark.parametrize("name", [*ROW.__dataclass_fields__, "rates"])
def test_a_missing_field_is_named(name: str):
    content = json.loads(ROW.to_json())
    del content[name]
    with pytest.raises(BadResult, match=name):
        ResultRow.from_json(json.dumps(content))


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b"3", b"\xff", b"[" * 100_000])
def test_what_is_no_result_is_refused_with_the_file_it_is_in(tmp_path, text):
    path = tmp_path / "row.json"
    path.write_bytes(text)
    with pytest.raises(BadResult, match=r"row\.json: .*must be"):
        ResultRow.read(path)


def test_a_result_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(BadResult, match="No such file"):
        ResultRow.read(tmp_path / "row.json")
