"""The log of a campaign: what was played is kept, whatever happened to the file or the code."""

import json
from dataclasses import asdict

import pytest
from made_up_outcomes import FAILED, SOLVED

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_record import decode
from lerobot_env_bimanual.experts.outcome import Job, Outcome
from lerobot_env_bimanual.experts.outcome_log import OutcomeLog
from lerobot_env_bimanual.tasks.registry import TASKS


def test_an_outcome_survives_the_way_through_json():
    for outcome in (SOLVED, FAILED):
        assert decode(Outcome, json.loads(json.dumps(asdict(outcome))), "outcome") == outcome


def test_the_log_knows_finished_jobs_and_forgets_those_of_other_code_and_a_cut_line(tmp_path):
    path = tmp_path / "some" / "log.jsonl"
    first, second = (Job("lift_ball", "0", "test", seed, "expert") for seed in (0, 1))
    log = OutcomeLog(path)
    log.add(first, SOLVED)
    log.add(second, FAILED)
    with path.open("r+") as file:
        file.truncate(path.stat().st_size - 20)
    again = OutcomeLog(path)
    assert again.get(first) == SOLVED
    assert again.get(second) is None
    again.add(second, SOLVED)
    header, _, lines = path.read_text().partition("\n")
    path.write_text(header.replace('"mujoco": "3', '"mujoco": "2') + "\n" + lines)
    assert OutcomeLog(path).get(first) is None
    log.remove()
    assert not path.exists()


def test_the_log_forgets_outcomes_of_somebody_elses_task_whose_file_has_changed(tmp_path, monkeypatch):
    (tmp_path / "their_task.py").write_text("MASS_KG = 1")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(TASKS.modules, "their_task", "their_task")
    path, job = tmp_path / "log.jsonl", Job("lift_ball", "0", "test", 0, "expert")
    OutcomeLog(path).add(job, SOLVED)
    assert OutcomeLog(path).get(job) == SOLVED
    (tmp_path / "their_task.py").write_text("MASS_KG = 2")
    assert OutcomeLog(path).get(job) is None


@pytest.mark.parametrize("damage", ["{", "[]", '{"job": "a"}', "\xff", '{"job": "a", "outcome": {}}', ""])
def test_a_log_with_damage_before_its_end_is_named_and_kept(damage, tmp_path):
    path = tmp_path / "log.jsonl"
    log = OutcomeLog(path)
    for seed in (0, 1):
        log.add(Job("lift_ball", "0", "test", seed, "expert"), SOLVED)
    header, _, last = path.read_text().splitlines()
    damaged = "\n".join([header, damage, last, ""]).encode("latin-1")
    path.write_bytes(damaged)
    with pytest.raises(BimanualError, match=r"log\.jsonl, line 2: .*remove it to play them again"):
        OutcomeLog(path)
    assert path.read_bytes() == damaged


def test_a_log_that_was_killed_at_any_byte_gives_what_was_whole(tmp_path):
    path = tmp_path / "log.jsonl"
    job = Job("lift_ball", "0", "test", 0, "expert")
    OutcomeLog(path).add(job, SOLVED)
    content = path.read_bytes()
    header = content.index(b"\n")
    for size in (0, 1, header, header + 1, header + 2, len(content) - 1):
        path.write_bytes(content[:size])
        assert OutcomeLog(path).get(job) is None
        assert path.read_bytes() == content[: header + 1]
    path.write_bytes(content)
    assert OutcomeLog(path).get(job) == SOLVED
