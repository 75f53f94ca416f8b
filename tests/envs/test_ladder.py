"""Which rungs there are, who plays on them, and how an interrupted ladder goes on."""

import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock

import pytest
from made_up_players import TASK, MadeUpCampaign, MadeUpRollout, world_of

from lerobot_bimanual import cli
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.ladder.rung_certificate import RungCertificate
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.checkpoint import Checkpoint
from lerobot_env_bimanual.commands.expert_evaluate_perturbed import (
    ExpertEvaluatePerturbedConfig,
    expert_evaluate_perturbed,
)
from lerobot_env_bimanual.commands.policy_robustness import PolicyRobustnessConfig, policy_robustness
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.ladder import certification, climb
from lerobot_env_bimanual.ladder.controls import Controls
from lerobot_env_bimanual.ladder.rungs import rungs_of
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

TRAINED = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"


@pytest.fixture(autouse=True)
def nothing_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(climb, "Campaign", MadeUpCampaign)
    monkeypatch.setattr(certification, "Campaign", MadeUpCampaign)
    for room in (climb, certification):
        monkeypatch.setattr(room, "OutcomeLog", MagicMock())
    monkeypatch.setattr(climb, "RungRollout", MadeUpRollout)
    monkeypatch.setattr(MadeUpCampaign, "jobs", [], raising=False)
    monkeypatch.setattr(MadeUpRollout, "patience", 1000)


def config(tmp_path: Path, *axes: str, levels: tuple[int, ...] = (1, 3)) -> PolicyRobustnessConfig:
    output = tmp_path / "ladder.json"
    return PolicyRobustnessConfig(
        checkpoint=TRAINED, task=TASK, axes=axes, levels=levels, episodes=4, output=output
    )


@pytest.mark.parametrize("task", list_tasks())
def test_every_task_has_a_ladder_and_says_what_does_not_apply(task):
    rungs = rungs_of(task)
    names = [axis.name for axis in rungs.axes]
    assert sorted([*names, *rungs.not_applicable]) == list(list_axes())
    keys = [*rungs]
    assert keys == sorted(keys)
    assert keys[0] == ("", 0)
    assert len(keys) == 1 + 3 * len(names)


def test_axes_that_are_only_seen_are_played_by_nobody_who_does_not_look():
    rungs = rungs_of("lift_ball", ["mass", "camera_moved"])
    assert rungs.played_as("camera_moved", 2) == ("", 0)
    assert rungs.played_as("mass", 2) == ("mass", 2)


@pytest.mark.parametrize(
    ("axes", "levels", "message"),
    [
        (["masse"], [1], "axes is 'masse', but must be one of: arm_late"),
        (["mass"], [4], "levels is 4, but must be one of: 1, 2, 3"),
        (["mass"], [0], "levels is 0"),
        (["mass"], [], "levels is ''"),
    ],
)
def test_what_is_no_axis_or_level_is_refused_with_what_there_is(axes, levels, message):
    with pytest.raises(InvalidChoice, match=message):
        rungs_of("lift_ball", axes, levels)


def test_a_ladder_without_an_axis_that_applies_is_refused(monkeypatch):
    monkeypatch.setattr(type(get_axis("mass")), "applies_to", lambda *_: False)
    assert "mass" in rungs_of("lift_ball").not_applicable
    with pytest.raises(BimanualError, match="none of the axes mass finds anything to change in lift_ball"):
        rungs_of("lift_ball", ["mass"])


def test_the_blind_control_plays_the_mean_keyposes_of_the_variation_that_the_seed_draws():
    controls = Controls(MadeUpCampaign(), TASK, "any", "test")  # type: ignore[arg-type]
    assert controls.solved("blind", [("", 0), ("arm_late", 1)], range(4)) == {
        ("", 0): (0,),
        ("arm_late", 1): (0,),
    }
    spec = get_task(TASK).spec
    for job in MadeUpCampaign.jobs:
        assert job.variation == "any"  # so that the episode is the policy's
        assert job.blind_keyposes[0][0] == draw_episode(spec, "test", job.seed, None).variation.index
    assert {job.perturb for job in MadeUpCampaign.jobs} == {"", "arm_late:1"}


def test_an_interrupted_ladder_keeps_its_rungs_and_goes_on(tmp_path, monkeypatch, capsys):
    chosen = config(tmp_path, "arm_late", "camera_moved")
    monkeypatch.setattr(MadeUpRollout, "patience", 2)
    with pytest.raises(KeyboardInterrupt, match="goes on where it stopped"):
        policy_robustness(chosen)
    assert [rung.name for rung in LadderResult.read(chosen.output).rungs] == ["level 0", "arm_late:1"]
    monkeypatch.setattr(MadeUpRollout, "patience", 3)  # just as many as are missing
    policy_robustness(chosen)
    result = LadderResult.read(chosen.output)
    names = ["level 0", "arm_late:1", "arm_late:3", "camera_moved:1", "camera_moved:3"]
    assert [rung.name for rung in result.rungs] == names
    assert result.by_name["camera_moved:3"].expert == (0, 1, 2, 3)
    assert "level 3: 4 of 8" in capsys.readouterr().out
    assert chosen.output.with_suffix(".png").is_file()
    monkeypatch.setattr(MadeUpRollout, "patience", 2)
    policy_robustness(replace(chosen, levels=(2,)))  # the file grows
    assert len(LadderResult.read(chosen.output).rungs) == 7


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 6}, "has seeds"),
        ({"batch_size": 1}, "has batch_size 2, but here it is 1"),
        ({"split": "val"}, "has options"),
        ({"task": "lift_ball"}, "has task"),
    ],
)
def test_a_file_of_other_episodes_is_not_mixed_with_these(changes, message, tmp_path):
    chosen = config(tmp_path, "arm_late", levels=(1,))
    policy_robustness(chosen)
    with pytest.raises(BimanualError, match=f"{message}.*choose another --output, or remove the file"):
        policy_robustness(replace(chosen, **changes))


def test_a_certificate_of_another_world_is_refused_and_one_of_this_decides(tmp_path):
    chosen = config(tmp_path, "arm_late", "camera_moved", levels=(3,))
    rungs = ExpertEvaluatePerturbedConfig(
        task=TASK, axes=("arm_late",), levels=(3,), seeds="0:40", blind_seeds="0:2", output=tmp_path / "rungs"
    )
    expert_evaluate_perturbed(rungs)
    policy_robustness(replace(chosen, certificates=rungs.output))
    result = LadderResult.read(chosen.output)
    assert [rung.certificate for rung in result.rungs] == [SuccessRate(40, 40)] * 3
    chosen.output.unlink()
    path = rungs.output / f"{TASK}.json"
    path.write_text(path.read_text().replace(world_of("arm_late:3"), "elsewhere"))
    MadeUpCampaign.jobs.clear()
    with pytest.raises(BimanualError, match="is of world elsewhere, but here it is"):
        policy_robustness(replace(chosen, certificates=rungs.output))
    assert not MadeUpCampaign.jobs  # it was noticed before anything was played
    assert not chosen.output.exists()


def test_a_certificate_that_comes_later_decides_on_the_rungs_that_are_played_already(tmp_path, capsys):
    chosen = config(tmp_path, "arm_late", "camera_moved", levels=(3,))
    policy_robustness(chosen)
    rungs = ExpertEvaluatePerturbedConfig(
        task=TASK, seeds="0:40", blind_seeds="0:2", output=tmp_path / "rungs"
    )
    expert_evaluate_perturbed(replace(rungs, task="lift_ball", axes=("mass",)))
    policy_robustness(replace(chosen, certificates=rungs.output))
    assert f"holds no certificate of {TASK}, only of lift_ball" in capsys.readouterr().out
    assert {rung.certificate for rung in LadderResult.read(chosen.output).rungs} == {None}
    expert_evaluate_perturbed(replace(rungs, axes=("arm_late",), levels=(3,)))
    MadeUpCampaign.jobs.clear()
    policy_robustness(replace(chosen, certificates=rungs.output))
    assert {rung.certificate for rung in LadderResult.read(chosen.output).rungs} == {SuccessRate(40, 40)}
    policy_robustness(chosen)  # which forgets nothing
    assert {rung.certificate for rung in LadderResult.read(chosen.output).rungs} == {SuccessRate(40, 40)}
    assert not MadeUpCampaign.jobs


@pytest.mark.parametrize("rung", ["level 0", "arm_late:1", "camera_moved:1"])
def test_rungs_of_another_world_are_not_mixed_with_these(rung, tmp_path):
    chosen = config(tmp_path, "arm_late", "camera_moved", levels=(1,))
    policy_robustness(chosen)
    result = LadderResult.read(chosen.output)
    changed = [replace(one, world="elsewhere") if one.name == rung else one for one in result.rungs]
    replace(result, rungs=tuple(changed)).write(chosen.output)
    MadeUpCampaign.jobs.clear()
    with pytest.raises(
        BimanualError, match=f"has world of {rung} .*elsewhere.* choose another --output, or remove"
    ):
        policy_robustness(replace(chosen, levels=(1, 2)))
    assert not MadeUpCampaign.jobs


def test_certificates_of_rungs_list_failures_grow_and_play_anew_what_has_changed(tmp_path, capsys):
    chosen = ExpertEvaluatePerturbedConfig(
        task="lift_ball",
        axes=("mass", "camera_moved"),
        levels=(3,),
        seeds="0:20",
        blind_seeds="0:3",
        output=tmp_path,
    )
    expert_evaluate_perturbed(chosen)
    certificate = RungCertificate.read(tmp_path / "lift_ball.json")
    assert [rung.name for rung in certificate.rungs] == ["level 0", "mass:3"]  # what is only seen is left out
    assert certificate.rungs[1].expert_failed == (1,)
    assert certificate.rungs[0].blind_solved == (0,)
    assert "not certified: mass:3, expert 19/20" in capsys.readouterr().out
    MadeUpCampaign.jobs.clear()
    expert_evaluate_perturbed(replace(chosen, levels=(1, 3)))
    assert {job.perturb for job in MadeUpCampaign.jobs} == {"mass:1"}
    path = tmp_path / "lift_ball.json"
    path.write_text(path.read_text().replace(world_of("mass:3"), "elsewhere"))
    MadeUpCampaign.jobs.clear()
    expert_evaluate_perturbed(chosen)
    assert {job.perturb for job in MadeUpCampaign.jobs} == {"mass:3"}
    with pytest.raises(BimanualError, match="has expert_seeds"):
        expert_evaluate_perturbed(replace(chosen, seeds="0:30"))


def test_a_checkpoint_says_which_images_it_reads():
    checkpoint = Checkpoint.read(TRAINED)
    assert checkpoint.policy == "peract2"
    assert checkpoint.options == {
        "cameras": "front,left_shoulder,right_shoulder,left_wrist,right_wrist",
        "image_size": "128x128",
    }


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (None, "does not exist. Give the folder `pretrained_model`"),
        ([], "names no policy `type`"),
        ({"type": "act"}, "names no policy `type`, or no `input_features`"),
        ({"type": "act", "input_features": {"observation.images.front": {"shape": [3, 9]}}}, "three sides"),
    ],
)
def test_what_is_no_checkpoint_is_refused_on_one_line(config, message, tmp_path, capsys):
    (tmp_path / "model.safetensors").touch()
    if config is not None:
        (tmp_path / "config.json").write_text(json.dumps(config))
    assert cli.main(["policy", "robustness", f"--checkpoint={tmp_path}", "--task=lift_ball"]) == 1
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--task=lift_bal"], "unknown task 'lift_bal'. Did you mean 'lift_ball'?"),
        (["--task=lift_ball", "--axes=heat"], "axes is 'heat'"),
        (["--task=lift_ball", "--episodes=0"], "episodes is 0"),
        (["--task=lift_ball", "--variation=7"], "no variation 7"),
        (["--task=lift_ball", "--certificates=/nowhere"], "holds no certificates of rungs"),
    ],
)
def test_bad_flags_get_one_clear_line(flags, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["policy", "robustness", f"--checkpoint={TRAINED}", *flags]) == 1
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error
