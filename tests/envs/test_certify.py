"""Certificates: what they count, what they complain of, and that an interrupted one goes on."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from lerobot_bimanual.cli.command_line import main
from lerobot_bimanual.errors import BimanualError, PlacementFailure, UnknownTask, UnknownVariation
from lerobot_bimanual.json_record import decode
from lerobot_env_bimanual.commands.certify import CertifyConfig, certify
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.reset import EpisodeReset
from lerobot_env_bimanual.expert import campaign, outcome_log
from lerobot_env_bimanual.expert.campaign import Campaign
from lerobot_env_bimanual.expert.control_names import CONTROLS, EXPERTS, ROUNDABLE
from lerobot_env_bimanual.expert.coupling import Coupling, mean_coupling
from lerobot_env_bimanual.expert.criteria import MAX_RATES, complaints, rates
from lerobot_env_bimanual.expert.evidence import Evidence, EvidenceRecorder
from lerobot_env_bimanual.expert.outcome import Job, MoveReport, Outcome
from lerobot_env_bimanual.expert.outcome_log import OutcomeLog
from lerobot_env_bimanual.expert.runner import run_expert
from lerobot_env_bimanual.expert.seed_range import parse_seeds
from lerobot_env_bimanual.expert.strain import Strain
from lerobot_env_bimanual.worker import Failure, WorkFailed

NO_COUPLING = Coupling(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
NO_STRAIN = Strain(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, "")
SOLVED = Outcome(
    task="lift_ball",
    variation=0,
    split="test",
    seed=0,
    success=True,
    failure="",
    last_move="lift",
    unmet=(),
    keyposes=(MoveReport("beside", (0.0,) * 18, 20, (1.0, 2.0), arrived=True),),
    ticks=20,
    draws=1,
    line_fallbacks=0,
    unstable=False,
    state_hash="00",
    evidence=Evidence(keyframes_found=True, replayed=True, coupling=NO_COUPLING, strain=NO_STRAIN),
)
FAILED = replace(SOLVED, success=False, failure="no move left", unmet=("above(ball)",), evidence=None)


def episodes(solved: int, failed: int) -> list[Outcome]:
    return [replace(o, seed=seed) for seed, o in enumerate([SOLVED] * solved + [FAILED] * failed)]


@pytest.mark.parametrize("text", ["", "5", "3:3", "4:2", "a:b", "-1:2", "0:1:2", "0:²", f"0:{'9' * 5000}"])
def test_seeds_that_are_no_range_are_refused(text):
    with pytest.raises(BimanualError, match="half-open range"):
        parse_seeds(text)


def test_seeds_are_a_half_open_range():
    assert list(parse_seeds("3:6")) == [3, 4, 5]


def test_certify_refuses_unknown_tasks_before_it_starts_anything():
    with pytest.raises(UnknownTask, match="lift_ball"):
        certify(CertifyConfig(task="lift_bal"))


def test_certify_refuses_unknown_variations_before_it_starts_anything():
    with pytest.raises(UnknownVariation, match="'lift_ball' has no variation 7"):
        certify(CertifyConfig(task="lift_ball", variation="7"))


@pytest.mark.parametrize("control", CONTROLS)
def test_certify_refuses_roundings_and_replays_that_would_change_nothing(control, monkeypatch):
    def started(*_):
        raise BimanualError("it starts")

    monkeypatch.setattr(campaign, "Campaign", started)
    monkeypatch.setattr("lerobot_env_bimanual.solo.ways.find_ways", str)  # not everybody wrote one
    for option, value, takes in (("discretise", 100, ROUNDABLE), ("replay", "joint", EXPERTS)):
        words = "it starts" if control in takes else f"^{option} of the control '{control}'"
        with pytest.raises(BimanualError, match=words):
            certify(CertifyConfig(control=control, **{option: value}))


@pytest.mark.parametrize(
    ("discretise", "failed", "enough"), [(0, 1, True), (0, 2, False), (100, 3, True), (100, 4, False)]
)
@pytest.mark.parametrize("control", EXPERTS)
def test_experts_must_succeed_in_99_percent_and_97_percent_rounded(control, discretise, failed, enough):
    found = complaints(control, discretise, episodes(100 - failed, failed))
    assert (found == []) is enough


@pytest.mark.parametrize(
    ("flaw", "complaint"),
    [
        ({"unstable": True}, "unstable"),
        (
            {"keyposes": (replace(SOLVED.keyposes[0], arrived=False, tip_error_mm=(1.0, 30.0)),)},
            "1 and 30 mm",
        ),
        ({"evidence": Evidence(True, False, NO_COUPLING, NO_STRAIN)}, "replay"),
        (
            {"evidence": Evidence(False, True, NO_COUPLING, NO_STRAIN)},
            "keyframe discovery is right in 0 of 1",
        ),
        (
            {"evidence": Evidence(True, True, NO_COUPLING, replace(NO_STRAIN, contact_force_n=554.0))},
            "contact_force_n is 554, but must be at most 100",
        ),
    ],
)
def test_a_solved_episode_with_a_flaw_is_complained_of(flaw, complaint):
    assert complaints("expert", 0, [SOLVED]) == []
    (found,) = complaints("expert", 0, [replace(SOLVED, **flaw)])
    assert complaint in found


def test_what_rounded_keyposes_ask_of_the_arms_is_measured_and_not_limited():
    pressed = replace(
        SOLVED, evidence=replace(SOLVED.evidence, strain=replace(NO_STRAIN, contact_force_n=554.0))
    )
    assert complaints("expert", 100, [pressed]) == []


def test_controls_must_fail():
    assert complaints("noop", 0, episodes(0, 50)) == []
    assert "noop succeeds in 1 of 50" in complaints("noop", 0, episodes(1, 49))[0]
    assert "random succeeds" in complaints("random", 0, episodes(1, 49))[0]
    swept = [replace(outcome, task="put_item_in_drawer") for outcome in episodes(6, 44)]
    assert complaints("random", 0, [*swept[1:], swept[-1]]) == []  # as its file says
    assert "random succeeds in 6 of 50" in complaints("random", 0, swept)[0]
    assert complaints("blind", 0, episodes(10, 40)) == []
    assert "blind succeeds in 11 of 50" in complaints("blind", 0, episodes(11, 39))[0]


def test_what_is_measured_without_a_limit_is_still_not_to_be_unstable():
    for control in ("solo_left", "solo_right", "language_blind"):
        assert complaints(control, 0, episodes(50, 0)) == []
        assert "unstable" in complaints(control, 0, [replace(SOLVED, unstable=True)])[0]


def test_every_control_has_its_limit():
    assert {*EXPERTS, "random", *MAX_RATES} == set(CONTROLS)


def test_rates_are_per_task_and_variation():
    outcomes = [SOLVED, FAILED, replace(SOLVED, variation=1)]
    assert {key: (rate.successes, rate.trials) for key, rate in rates(outcomes).items()} == {
        ("lift_ball", 0): (1, 2),
        ("lift_ball", 1): (1, 1),
    }


def test_the_mean_coupling_is_taken_field_by_field():
    assert mean_coupling([NO_COUPLING, Coupling(2.0, 4.0, 6.0, 0.0, 0.0, 0.0)]) == Coupling(
        1.0, 2.0, 3.0, 0.5, 0.5, 0.5
    )


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
    monkeypatch.setattr(outcome_log, "task_modules", lambda: {"their_task": "their_task"})
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


@pytest.mark.sim
def test_an_interrupted_campaign_plays_only_what_is_missing(tmp_path):
    jobs = [Job("lift_ball", "0", "val", seed, "expert") for seed in (0, 1)]
    log = OutcomeLog(tmp_path / "log.jsonl")
    invented = replace(SOLVED, seed=0, state_hash="from the log")
    log.add(jobs[0], invented)
    with Campaign(1, log) as running:
        first, second = running.play(jobs, "expert")
    assert first == invented
    assert second.success
    assert log.get(jobs[1]) == second


@pytest.mark.sim
def test_certify_writes_the_same_episodes_with_any_number_of_workers(tmp_path, capsys):
    certificates = []
    for workers in (1, 2):
        output = tmp_path / "certificates" / f"{workers}.json"
        assert (
            certify(CertifyConfig("lift_ball", seeds="0:3", discretise=100, workers=workers, output=output))
            == 0
        )
        certificates.append(json.loads(output.read_text()))
        assert list(output.parent.glob("*.partial*")) == []
    first, second = certificates
    assert first == second
    assert [episode["seed"] for episode in first["episodes"]] == [0, 1, 2]
    (rate,) = first["rates"]
    assert (rate["task"], rate["variation"], rate["successes"], rate["trials"]) == ("lift_ball", 0, 3, 3)
    assert rate["wilson_95"] == pytest.approx([0.4385, 1.0], abs=1e-4)
    assert rate["keyframes_found"] == 3
    assert rate["coupling"]["shared_object_s"] > 0
    assert rate["strain"]["contact_force_n"] > 10
    assert rate["acceptance"] == 3 / sum(episode["draws"] for episode in first["episodes"])
    names = [name for name, *_ in first["episodes"][0]["keyposes"]]
    assert names == ["beside", "squeeze", "lift"]
    assert "3/3" in capsys.readouterr().out


def test_certify_exits_with_one_and_says_why(monkeypatch, capsys):
    monkeypatch.setattr(Campaign, "play", lambda *_: episodes(98, 2))
    assert certify(CertifyConfig("lift_ball", seeds="0:100")) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "98/100" in printed
    assert "unmet: above(ball)" in printed
    assert "not good enough: lift_ball, variation 0: 98/100 is less than 99%" in printed


def test_a_seed_without_a_placement_is_a_failed_episode_and_not_the_end(monkeypatch):
    def start(*_):
        raise PlacementFailure("lift_ball: none of 200 drawn placements can be rehearsed")

    monkeypatch.setattr(EpisodeReset, "start", start)
    outcome = campaign.play(Job("lift_ball", "0", "val", 5, "expert"))
    assert (outcome.seed, outcome.success, outcome.ticks) == (5, False, 0)
    assert "none of 200" in outcome.failure


@pytest.fixture(scope="module")
def env():
    env = BimanualEnv("lift_ball", split="val", obs="state")
    yield env
    env.close()


def noted(env):
    moves = []
    recorder = EvidenceRecorder(env)
    with env.observed_by(recorder.note, recorder.note_step):
        outcome = run_expert(env, 2, on_move=moves.append)
    assert not env.tick_observers
    assert not env.step_observers
    return recorder, [move.action for move in moves], [report.ticks for report in outcome.keyposes]


@pytest.mark.sim
@pytest.mark.parametrize("mode", ["joint", "keypose"])
def test_an_episode_replays_from_its_actions(env, mode):
    recorder, keyposes, ticks = noted(env)
    evidence = recorder.evidence(keyposes, ticks, mode)
    assert evidence.replayed is True
    assert evidence.keyframes_found
    assert evidence.coupling.transmitted_force_peak_n > 10


@pytest.mark.sim
def test_a_replay_of_other_actions_is_found_out(env):
    recorder, keyposes, ticks = noted(env)
    keyposes[0] = keyposes[0] + np.float32(1e-6)
    assert recorder.evidence(keyposes, ticks, "keypose").replayed is False


@pytest.mark.sim
def test_wrong_keyframes_are_found_out(env):
    recorder, keyposes, ticks = noted(env)
    ticks[0] += 5
    ticks[1] -= 5
    evidence = recorder.evidence(keyposes, ticks, "none")
    assert not evidence.keyframes_found
    assert evidence.replayed is None


@pytest.mark.parametrize("workers", [1, 2])
def test_an_accident_is_an_error_that_names_the_episode_after_all_others_are_played_and_noted(
    workers, tmp_path
):
    log = OutcomeLog(tmp_path / "log.jsonl")
    jobs = [
        Job("lift_ball", "any", "test", seed, control)
        for seed, control in enumerate(("noop", "nobody", "noop"))
    ]
    told = r"one episode was not played \(nobody on seed 1 of lift_ball: .*\); the same command tries again"
    with Campaign(workers, log) as campaign:
        with pytest.raises(BimanualError, match=told):
            campaign.play(jobs, "playing")
        assert [(outcome := log.get(job)) and outcome.seed for job in jobs] == [0, None, 2]
        assert len(campaign.play([jobs[0], jobs[2]], "playing")) == 2


def test_an_accident_writes_no_certificate_and_keeps_what_was_played(tmp_path, monkeypatch):
    output = tmp_path / "noop.json"
    words = [
        "certify",
        "--task=lift_ball",
        "--control=noop",
        "--seeds=0:2",
        "--workers=1",
        f"--output={output}",
    ]
    with monkeypatch.context() as patched:
        patched.setattr(Campaign, "_answers", with_an_accident(Campaign._answers))
        assert main(words) == 1
    assert not output.exists()
    (kept,) = tmp_path.iterdir()
    assert len(kept.read_text().splitlines()) == 2, "its head, and the other episode"
    assert main(words) == 0
    assert [*tmp_path.iterdir()] == [output]


def with_an_accident(answers):
    """As the death of whoever plays the first item."""

    def changed(*arguments):
        for index, answer in answers(*arguments):
            yield index, Failure(WorkFailed("killed")) if index == 0 else answer

    return changed
