"""`expert evaluate`, its evaluator and its log: what is kept and written, and that nothing is played twice."""

from dataclasses import replace
from unittest.mock import Mock

import pytest
from sample_results import outcome, outcomes

from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_bimanual.results.expert_report import EpisodeOutcome, ExpertReport
from lerobot_env_bimanual.commands.expert_evaluate import ExpertEvaluateConfig, expert_evaluate
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.sweep.evaluator import EpisodeLog, EpisodeSpec, Evaluator, play
from lerobot_env_bimanual.tasks.registry import TASKS
from lerobot_env_bimanual.worlds import EpisodeReset

FIRST, SECOND = (EpisodeSpec("lift_ball", "0", "val", seed, "expert") for seed in (0, 1))


def test_an_interrupted_run_plays_only_what_is_missing(tmp_path):
    log = EpisodeLog(tmp_path / "log.jsonl")
    log.keep(FIRST, outcome(last_move="from the log"))
    with Evaluator(1, log) as running:
        first, second = running.play([FIRST, SECOND], "expert")
    assert first == outcome(last_move="from the log")
    assert second.success
    assert log.get(SECOND) == second == EpisodeLog(tmp_path / "log.jsonl").get(SECOND)


def test_evaluate_writes_the_same_episodes_with_any_number_of_workers(tmp_path, capsys):
    reports = []
    for workers in (1, 2):
        output = tmp_path / "reports" / f"{workers}.json"
        config = ExpertEvaluateConfig("lift_ball", episodes=3, discretise=100, workers=workers, output=output)
        assert expert_evaluate(config) == 0
        reports.append(ExpertReport.read(output))
        assert list(output.parent.glob("*.partial*")) == []
    first, second = reports
    assert first == second
    assert [episode.seed for episode in first.episodes] == [0, 1, 2]
    assert all(episode.success and episode.keyframes_found for episode in first.episodes)
    load = first.load("lift_ball")
    assert load is not None
    assert load.contact_force_n > 10
    assert [move.name for move in first.episodes[0].moves] == ["beside", "squeeze", "lift"]
    assert "3/3" in capsys.readouterr().out


def test_evaluate_exits_with_one_and_says_why(monkeypatch, capsys):
    monkeypatch.setattr(Evaluator, "play", lambda *_: outcomes(98, 2))
    assert expert_evaluate(ExpertEvaluateConfig("lift_ball")) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "98/100" in printed
    assert "unmet: above(ball)" in printed
    assert "violation: lift_ball, variation 0: 98/100 is less than 99%" in printed


def test_a_report_is_extended_and_other_seeds_variations_or_worlds_are_played_anew(tmp_path, monkeypatch):
    asked: list[EpisodeSpec] = []

    def fail(_, specs: list[EpisodeSpec], label: str) -> list[EpisodeOutcome]:
        asked.extend(specs)
        return [outcome(False, each.seed, task=each.task, variation=int(each.variation)) for each in specs]

    def played(task: str, **changes) -> set[tuple[str, str, int]]:
        asked.clear()
        expert_evaluate(replace(config, task=task, **changes))
        report = ExpertReport.read(output)
        assert [*report.worlds] == sorted(report.worlds)
        assert len(report.violations) == len(report.by_variation)  # one for each variation in the report
        return {(spec.task, spec.variation, spec.seed) for spec in asked}

    monkeypatch.setattr(Evaluator, "play", fail)
    output = tmp_path / "expert.json"
    config = ExpertEvaluateConfig(variation="each", episodes=2, output=output)
    ball = {("lift_ball", "0", 0), ("lift_ball", "0", 1)}
    assert played("lift_ball") == ball
    buttons = played("dual_push_buttons,lift_ball")
    assert {task for task, *_ in buttons} == {"dual_push_buttons"}
    assert played("lift_ball,dual_push_buttons") == set()
    output.write_text(output.read_text().replace(world_version("lift_ball"), "0" * 12))
    assert played("dual_push_buttons,lift_ball") == ball
    assert [*ExpertReport.read(output).worlds] == ["dual_push_buttons", "lift_ball"]
    for variation in ("1", "2"):
        expected = {("dual_push_buttons", variation, seed) for seed in (0, 1)}
        assert played("dual_push_buttons", variation=variation) == expected
    assert played("lift_ball", first_seed=1) == {("lift_ball", "0", 1), ("lift_ball", "0", 2)}
    assert [*ExpertReport.read(output).worlds] == ["lift_ball"]  # of other options: replaced


def test_a_replay_of_joint_actions_is_refused_where_a_perturbation_depends_on_keyposes():
    with pytest.raises(BimanualError, match=r"replay under misses, where joint actions .* is 'joint'"):
        expert_evaluate(ExpertEvaluateConfig("lift_ball", perturb="mass:1,misses:1", replay="joint"))


def test_a_second_evaluation_into_the_same_file_is_refused(tmp_path):
    config = ExpertEvaluateConfig("lift_ball", output=tmp_path / "expert.json")
    log = EpisodeLog(tmp_path / "expert.partial.jsonl", exclusive=True)
    with pytest.raises(BimanualError, match="by another process; wait for it"):
        expert_evaluate(config)
    log.remove()


def test_a_seed_without_a_placement_is_a_failed_episode_and_not_the_end(monkeypatch):
    failure = PlacementFailure("lift_ball: none of 200 drawn placements can be rehearsed")
    monkeypatch.setattr(EpisodeReset, "start", Mock(side_effect=failure))
    failed = play(EpisodeSpec("lift_ball", "0", "val", 5, "expert"))
    assert (failed.seed, failed.success, failed.ticks) == (5, False, 0)
    assert "none of 200" in (failed.failure or "")


@pytest.mark.parametrize("workers", [1, 2])
def test_an_unexpected_error_names_its_episode_and_all_other_episodes_are_kept(workers, tmp_path):
    log = EpisodeLog(tmp_path / "log.jsonl")
    players = ("noop", "unknown", "noop")
    specs = [EpisodeSpec("lift_ball", "any", "test", seed, player) for seed, player in enumerate(players)]
    message = r"1 of 3 episodes were not played \(unknown on seed 1 of lift_ball: .*\); the same command tries again"
    with Evaluator(workers, log) as running:
        with pytest.raises(BimanualError, match=message):
            running.play(specs, "playing")
        assert [(found := log.get(spec)) and found.seed for spec in specs] == [0, None, 2]
        assert len(running.play([specs[0], specs[2]], "playing")) == 2


def test_the_log_forgets_episodes_of_other_versions_and_of_a_foreign_task_that_changed(tmp_path, monkeypatch):
    path, theirs = tmp_path / "some" / "log.jsonl", tmp_path / "their_task.py"
    theirs.write_text("MASS_KG = 1")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(TASKS.modules, "their_task", "their_task")
    for file, old, new in ((path, '"mujoco": "3', '"mujoco": "2'), (theirs, "1", "2")):
        log = EpisodeLog(path)
        log.keep(FIRST, outcome())
        log.keep(SECOND, outcome(success=False))
        assert EpisodeLog(path).get(SECOND) == outcome(success=False)
        file.write_text(file.read_text().replace(old, new))
        assert EpisodeLog(path).get(FIRST) is None
    log.keep(FIRST, outcome())  # by a process that still runs the code of before
    assert EpisodeLog(path).get(FIRST) is None
    log.remove()
    assert not path.exists()


@pytest.mark.parametrize("damage", ["{", "[]", '{"spec": "a"}', "\xff", ""])
def test_the_episode_of_a_damaged_line_of_the_log_is_played_again(damage, tmp_path):
    path = tmp_path / "log.jsonl"
    log = EpisodeLog(path)
    log.keep(FIRST, outcome())
    log.keep(SECOND, outcome())
    header, _, last = path.read_text().splitlines()
    path.write_bytes("\n".join([header, damage, last, ""]).encode("latin-1"))
    again = EpisodeLog(path)
    assert (again.get(FIRST), again.get(SECOND)) == (None, outcome())
