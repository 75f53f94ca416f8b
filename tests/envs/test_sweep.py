"""Sweeps: which conditions there are, who plays in them, what is refused, and how an interrupted one continues."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest
from sample_results import RESULT, outcome, proved

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.expert_report import EXPERTS, EpisodeOutcome
from lerobot_bimanual.results.robustness import ExpertRobustnessReport, RobustnessResult
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.commands.expert_evaluate import ExpertEvaluateConfig, expert_evaluate
from lerobot_env_bimanual.commands.policy_robustness import PolicyRobustnessConfig, policy_robustness
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.sweep import conditions, robustness
from lerobot_env_bimanual.sweep.conditions import conditions_of, solved_seeds
from lerobot_env_bimanual.sweep.evaluator import EpisodeSpec
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

TASK = "dual_push_buttons"
TRAINED = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"


def world(task: str, perturb: str) -> str:
    return f"{task} {perturb}".encode().hex()[-12:]


def drawn_variation(task: str, split: str, seed: int) -> int:
    return draw_episode(get_task(task).spec, split, seed, None).variation.index


class MadeUpEvaluator(contextlib.nullcontext):
    """The expert fails only seed 1 at `mass:3`; the open-loop baseline solves only seed 0."""

    specs: list[EpisodeSpec]
    n_means = 0

    def __init__(self, *_: Any):
        super().__init__(self)

    def mean_keyposes(self, task: str, variation: str) -> tuple[tuple[float, ...], ...]:
        MadeUpEvaluator.n_means += 1
        return ((float(variation), *[0.0] * 17),)

    def map(self, function: Any, items: Any, *_: Any, **__: Any) -> Iterator[str]:
        return (world(*function.args, item) for item in items)

    def play(self, specs: list[EpisodeSpec], label: str) -> list[EpisodeOutcome]:
        MadeUpEvaluator.specs += specs
        return [self.outcome(spec) for spec in specs]

    def outcome(self, spec: EpisodeSpec) -> EpisodeOutcome:
        success = spec.seed == 0
        if spec.player in EXPERTS:
            success = not (spec.seed == 1 and spec.perturb == "mass:3")
        variation = drawn_variation(spec.task, spec.split, spec.seed)
        return outcome(success, spec.seed, task=spec.task, variation=variation)


class MadeUpRollout:
    """A policy that solves even seeds, and is interrupted after some conditions."""

    remaining = 1000

    def __init__(self, checkpoint: Any, config: Any, batch_size: int, seeds: range, policy_flags: Any):
        self.seeds = seeds

    def play(self, perturb: str, records: Path, note: Any = lambda _: None) -> EvaluationRecord:
        if MadeUpRollout.remaining == 0:
            raise KeyboardInterrupt
        MadeUpRollout.remaining -= 1
        note(len(self.seeds))
        record: dict[str, Any] = {"task": TASK, "world": world(TASK, perturb), "options": {}, "versions": {}}
        record["episodes"] = tuple(
            episode.model_copy(update={"variation": drawn_variation(TASK, "test", episode.seed)})
            for episode in proved("".join("x."[seed % 2] for seed in self.seeds), self.seeds.start)
        )
        return RESULT.evaluation.model_copy(update=record)


@pytest.fixture(autouse=True)
def nothing_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (robustness, conditions):
        monkeypatch.setattr(module, "Evaluator", MadeUpEvaluator)
        monkeypatch.setattr(module, "EpisodeLog", MagicMock())
    monkeypatch.setattr(robustness, "PolicyRollout", MadeUpRollout)
    monkeypatch.setattr(MadeUpEvaluator, "specs", [], raising=False)
    monkeypatch.setattr(MadeUpRollout, "remaining", 1000)


def of_policy(tmp_path: Path, *axes: str, levels: tuple[int, ...] = (1, 3)) -> PolicyRobustnessConfig:
    return PolicyRobustnessConfig(
        checkpoint=TRAINED, task=TASK, axes=axes, levels=levels, episodes=4, output=tmp_path / "policy.json"
    )


def of_expert(tmp_path: Path, *axes: str, task: str = TASK, episodes: int = 40) -> ExpertEvaluateConfig:
    counts = {"episodes": episodes, "open_loop_episodes": 2}
    return ExpertEvaluateConfig(task=task, axes=axes, levels=(3,), output=tmp_path / "experts", **counts)


def move_to_another_world(path: Path, task: str, perturb: str) -> None:
    """Say of a condition in a file that it was played in another world; forget what was played so far."""
    path.write_text(path.read_text().replace(world(task, perturb), "0" * 12))
    MadeUpEvaluator.specs.clear()


@pytest.mark.parametrize("task", list_tasks())
def test_every_task_has_conditions_and_says_what_does_not_apply(task):
    conditions = conditions_of(task)
    names = [axis.name for axis in conditions.axes]
    assert sorted([*names, *conditions.not_applicable]) == sorted({*AXES.names} - {"misses", "sentences"})
    assert [*conditions] == [("", 0), *((name, level) for name in sorted(names) for level in (1, 2, 3))]


def test_a_task_to_which_no_axis_applies_is_left_out_of_a_sweep_and_refused_alone(tmp_path, capsys):
    assert "mass" in conditions_of("dual_push_buttons").not_applicable
    message = "none of the axes mass finds anything to change in dual_push_buttons"
    with pytest.raises(BimanualError, match=message):
        expert_evaluate(of_expert(tmp_path, "mass", task="dual_push_buttons"))
    expert_evaluate(of_expert(tmp_path, "mass", task="dual_push_buttons,lift_ball"))
    assert f"dual_push_buttons is left out: {message}" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "experts").iterdir()] == ["lift_ball.json"]


def test_the_open_loop_baseline_plays_the_mean_keyposes_of_the_variation_that_the_seed_draws():
    template = EpisodeSpec(TASK, "any", "test", 0, "expert")
    keys = [("", 0), ("nudge", 1)]
    found = solved_seeds(MadeUpEvaluator(), "open_loop", keys, template, range(4))  # type: ignore[arg-type]
    assert found == dict.fromkeys(keys, (0,))
    for spec in MadeUpEvaluator.specs:
        assert (spec.variation, spec.player) == ("any", "open_loop")  # so that the episode is the policy's
        assert spec.mean_keyposes[0][0] == drawn_variation(TASK, "test", spec.seed)
    MadeUpEvaluator.specs.clear()
    solved_seeds(MadeUpEvaluator(), "expert", keys, template, [0])  # type: ignore[arg-type]
    players = [(spec.player, spec.perturb) for spec in MadeUpEvaluator.specs]
    assert players == [("replanning", ""), ("replanning", "nudge:1")]


def test_an_interrupted_sweep_keeps_its_conditions_and_continues(tmp_path, monkeypatch, capsys):
    chosen = of_policy(tmp_path, "arm_late", "camera_moved")
    monkeypatch.setattr(MadeUpRollout, "remaining", 2)
    with pytest.raises(KeyboardInterrupt, match="continues where it stopped"):
        policy_robustness(chosen)
    names = ["nominal", "arm_late:1", "arm_late:3", "camera_moved:1", "camera_moved:3"]
    assert [each.name for each in RobustnessResult.read(chosen.output).conditions] == names[:2]
    monkeypatch.setattr(MadeUpRollout, "remaining", 3)  # as many as are missing
    policy_robustness(chosen)
    result = RobustnessResult.read(chosen.output)
    assert [each.name for each in result.conditions] == names
    assert result.by_key["camera_moved", 3].expert_solved == (0, 1, 2, 3)
    assert "level 3: 4 of 8" in capsys.readouterr().out
    monkeypatch.setattr(MadeUpRollout, "remaining", 2)
    policy_robustness(replace(chosen, levels=(2,)))  # the file grows
    assert len(RobustnessResult.read(chosen.output).conditions) == 7


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 6}, "has episodes 4, but here it is 6"),
        ({"first_seed": 1}, "has first_seed 0"),
        ({"eval_batch_size": 1}, "has batch_size 2, but here it is 1"),
        ({"split": "val"}, "has options"),
        ({"task": "lift_ball"}, "has task"),
    ],
)
def test_a_sweep_with_other_settings_is_not_added_to_the_file(changes, message, tmp_path):
    chosen = of_policy(tmp_path, "arm_late", levels=(1,))
    policy_robustness(chosen)
    with pytest.raises(BimanualError, match=f"{message}.*choose another --output, or remove the file"):
        policy_robustness(replace(chosen, **changes))


def test_an_expert_report_of_this_world_is_used_and_one_of_another_world_is_refused(tmp_path):
    chosen = of_policy(tmp_path, "arm_late", "camera_moved", levels=(3,))
    experts = of_expert(tmp_path, "arm_late")
    expert_evaluate(experts)
    policy_robustness(replace(chosen, expert_reports=experts.output))
    result = RobustnessResult.read(chosen.output)
    assert [each.expert_report for each in result.conditions] == [SuccessRate(40, 40)] * 3
    chosen.output.unlink()
    move_to_another_world(experts.output / f"{TASK}.json", TASK, "arm_late:3")
    with pytest.raises(BimanualError, match="is of world 000000000000, but here it is"):
        policy_robustness(replace(chosen, expert_reports=experts.output))
    assert not MadeUpEvaluator.specs  # refused before anything was played
    assert not chosen.output.exists()


@pytest.mark.parametrize("name", ["nominal", "camera_moved:1"])
def test_conditions_of_another_world_are_not_mixed_with_these(name, tmp_path):
    chosen = of_policy(tmp_path, "arm_late", "camera_moved", levels=(1,))
    policy_robustness(chosen)
    move_to_another_world(chosen.output, TASK, name.removeprefix("nominal"))
    with pytest.raises(BimanualError, match=f"has world of {name} .*choose another --output, or remove"):
        policy_robustness(replace(chosen, levels=(1, 2)))
    assert not MadeUpEvaluator.specs


def test_expert_reports_list_failures_grow_and_play_again_what_has_changed(tmp_path, capsys):
    chosen = of_expert(tmp_path, "mass", "camera_moved", task="lift_ball", episodes=20)
    expert_evaluate(chosen)
    path = chosen.output / "lift_ball.json"
    report = ExpertRobustnessReport.read(path)
    assert [each.name for each in report.conditions] == ["nominal", "mass:3"]  # what is only seen is left out
    assert report.conditions[1].expert_failed == (1,)
    assert report.nominal.open_loop_solved == (0,)
    assert "not valid: mass:3, expert 19/20" in capsys.readouterr().out
    MadeUpEvaluator.specs.clear()
    expert_evaluate(replace(chosen, levels=(1, 3)))
    assert {spec.perturb for spec in MadeUpEvaluator.specs} == {"mass:1"}
    move_to_another_world(path, "lift_ball", "mass:3")
    expert_evaluate(chosen)
    assert {spec.perturb for spec in MadeUpEvaluator.specs} == {"mass:3"}
    n_means = MadeUpEvaluator.n_means
    expert_evaluate(chosen)
    assert MadeUpEvaluator.n_means == n_means  # if nothing is missing, no training episodes are played
    with pytest.raises(BimanualError, match="has expert_episodes"):
        expert_evaluate(replace(chosen, episodes=30))
