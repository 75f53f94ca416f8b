"""The verb `certify` and its campaign: what it refuses, writes and complains of, and that an interrupted one goes on."""

import json
from dataclasses import replace

import pytest
from made_up_outcomes import SOLVED, episodes

from lerobot_bimanual.cli.command_line import main
from lerobot_bimanual.errors import BimanualError, PlacementFailure, UnknownTask, UnknownVariation
from lerobot_env_bimanual.commands.expert_evaluate import ExpertEvaluateConfig, expert_evaluate
from lerobot_env_bimanual.episode.reset import EpisodeReset
from lerobot_env_bimanual.experts import campaign
from lerobot_env_bimanual.experts.campaign import Campaign
from lerobot_env_bimanual.experts.control_names import CONTROLS, EXPERTS
from lerobot_env_bimanual.experts.outcome import Job
from lerobot_env_bimanual.experts.outcome_log import OutcomeLog
from lerobot_env_bimanual.experts.seed_range import parse_seeds
from lerobot_env_bimanual.workers import Failure, WorkFailed


@pytest.mark.parametrize("text", ["", "5", "3:3", "4:2", "a:b", "-1:2", "0:1:2", "0:²", f"0:{'9' * 5000}"])
def test_seeds_that_are_no_range_are_refused(text):
    with pytest.raises(BimanualError, match="half-open range"):
        parse_seeds(text)


def test_seeds_are_a_half_open_range():
    assert list(parse_seeds("3:6")) == [3, 4, 5]


def test_certify_refuses_unknown_tasks_before_it_starts_anything():
    with pytest.raises(UnknownTask, match="lift_ball"):
        expert_evaluate(ExpertEvaluateConfig(task="lift_bal"))


def test_certify_refuses_unknown_variations_before_it_starts_anything():
    with pytest.raises(UnknownVariation, match="'lift_ball' has no variation 7"):
        expert_evaluate(ExpertEvaluateConfig(task="lift_ball", variation="7"))


@pytest.mark.parametrize("control", CONTROLS)
def test_certify_refuses_roundings_and_replays_that_would_change_nothing(control, monkeypatch):
    def started(*_):
        raise BimanualError("it starts")

    monkeypatch.setattr(campaign, "Campaign", started)
    for option, value, takes in (("discretise", 100, EXPERTS), ("replay", "joint", EXPERTS)):
        words = "it starts" if control in takes else f"^{option} of the control '{control}'"
        with pytest.raises(BimanualError, match=words):
            expert_evaluate(ExpertEvaluateConfig(control=control, **{option: value}))


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
            expert_evaluate(
                ExpertEvaluateConfig("lift_ball", seeds="0:3", discretise=100, workers=workers, output=output)
            )
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
    assert rate["strain"]["contact_force_n"] > 10
    assert rate["acceptance"] == 3 / sum(episode["draws"] for episode in first["episodes"])
    names = [name for name, *_ in first["episodes"][0]["keyposes"]]
    assert names == ["beside", "squeeze", "lift"]
    assert "3/3" in capsys.readouterr().out


def test_certify_exits_with_one_and_says_why(monkeypatch, capsys):
    monkeypatch.setattr(Campaign, "play", lambda *_: episodes(98, 2))
    assert expert_evaluate(ExpertEvaluateConfig("lift_ball", seeds="0:100")) == 1
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
        "expert",
        "evaluate",
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
