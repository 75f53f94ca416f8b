"""Trained policies under perturbations: nominal is what `lerobot-eval` gives, every condition is played again from its record."""

from pathlib import Path

import pytest
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.policies import make_pre_post_processors
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from programs import run

import lerobot_policy_bimanual  # noqa: F401  (registers its policies)
from lerobot_bimanual import cli
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.robustness import RobustnessResult

pytestmark = pytest.mark.slow

TASK = "handover_item_easy"
TRAINED = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"
SEEDS = (3, 4)


def sweep(output: Path, *flags: str) -> RobustnessResult:
    words = [f"--checkpoint={TRAINED}", f"--task={TASK}", f"--output={output}", "--device=cpu"]
    counts = [f"--first_seed={SEEDS[0]}", f"--episodes={len(SEEDS)}"]
    assert cli.main(["policy", "robustness", *words, *counts, *flags]) == 0
    return RobustnessResult.read(output)


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two axes, one of them at two levels, in two commands."""
    output = tmp_path_factory.mktemp("sweep") / "mine.json"
    sweep(output, "--axes=mass", "--levels=1")
    sweep(output, "--axes=mass,camera_miscalibrated", "--levels=3")
    return output


def records(output: Path) -> dict[str, EvaluationRecord]:
    """By condition."""
    folder = output.with_name("mine_records")
    found = [EvaluationRecord.read(path) for path in sorted(folder.glob("*.json"))]
    return {record.perturb or "nominal": record for record in found}


@pytest.mark.parametrize(("episodes_before", "asynchronous"), [(0, False), (2, True)])
def test_nominal_is_what_lerobot_eval_gives_bit_for_bit(played, tmp_path, episodes_before, asynchronous):
    policy = (f"--policy.path={TRAINED}", "--policy.device=cpu", f"--seed={SEEDS[0] - episodes_before}")
    env = ("--env.type=bimanual", f"--env.task={TASK}", "--env.image_size=128")
    counts = (f"--eval.n_episodes={episodes_before + len(SEEDS)}", "--eval.batch_size=2")
    places = (f"--env.results_dir={tmp_path}", f"--output_dir={tmp_path}")
    beside = f"--eval.use_async_envs={str(asynchronous).lower()}"
    run("lerobot-eval", *policy, *env, *counts, *places, beside, folder=tmp_path)
    stock, ours = EvaluationRecord.read(tmp_path / f"{TASK}_test_record.json"), records(played)["nominal"]
    # The proof of an episode holds every action and the state after it.
    assert [episode.seed for episode in ours.episodes] == [*SEEDS]
    assert stock.episodes[episodes_before:] == ours.episodes
    assert all(episode.keyposes > 1 for episode in ours.episodes)
    assert stock.policy.pop("seed") == SEEDS[0] - episodes_before
    assert ours.policy.pop("seed") == SEEDS[0]
    # Sizes of images may be written in two ways.
    same = {"options": {}, "episodes": ()}
    assert ours.model_copy(update=same) == stock.model_copy(update=same)


def test_every_condition_is_of_the_same_episodes_and_its_record_is_played_again_as_claimed(played, capfd):
    result, kept = RobustnessResult.read(played), records(played)
    names = ["nominal", "camera_miscalibrated:3", "mass:1", "mass:3"]
    assert [condition.name for condition in result.conditions] == names
    assert kept.keys() == set(names)
    for condition in result.conditions:
        assert condition.rates["expert"].successes == len(SEEDS)
        assert condition.world == kept[condition.name].world
        for claimed, episode in zip(condition.episodes, kept[condition.name].episodes, strict=True):
            assert claimed.success == episode.success
    assert len({condition.world for condition in result.conditions}) == len(names)
    starts = {name: [episode.proof.start for episode in record.episodes] for name, record in kept.items()}
    assert starts["camera_miscalibrated:3"] == starts["nominal"]
    instructions = {tuple(each.proof.instruction for each in record.episodes) for record in kept.values()}
    assert len(instructions) == 1
    assert cli.main(["results", "verify", f"--results={played.with_name('mine_records')}", "--sample=1"]) == 0
    assert capfd.readouterr().out.count("as claimed") == 4


@pytest.fixture
def of_mixed_precision(tmp_path: Path) -> Path:
    """A tiny ACT whose config says that it was trained in mixed precision, as LeRobot saves it."""
    config = ACTConfig(
        input_features={
            "observation.images.front": PolicyFeature(FeatureType.VISUAL, (3, 64, 64)),
            "observation.state": PolicyFeature(FeatureType.STATE, (16,)),
        },
        output_features={"action": PolicyFeature(FeatureType.ACTION, (16,))},
        pretrained_backbone_weights=None,
        device="cpu",
        use_amp=True,
    )
    folder = tmp_path / "pretrained_model"
    ACTPolicy(config).save_pretrained(folder)
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(folder)
    return folder


@pytest.mark.weekly
def test_a_policy_of_mixed_precision_is_played_in_full_precision(of_mixed_precision, tmp_path, capsys):
    output = tmp_path / "act.json"
    flags = [f"--task={TASK}", f"--output={output}", "--axes=mass", "--levels=1", "--episodes=1"]
    words = ["policy", "robustness", f"--checkpoint={of_mixed_precision}", "--device=cpu", *flags]
    assert cli.main(words) == 1
    error = capsys.readouterr().err
    assert "unsupported ScalarType BFloat16; play it with --use_amp=false" in error
    assert "Traceback" not in error
    assert cli.main([*words, "--use_amp=false"]) == 0
    assert [condition.name for condition in RobustnessResult.read(output).conditions] == ["nominal", "mass:1"]


def test_a_dry_run_tells_the_conditions_and_plays_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    flags = [f"--checkpoint={TRAINED}", f"--task={TASK}", "--axes=mass", "--device=cpu", "--dry_run"]
    assert cli.main(["policy", "robustness", *flags]) == 0
    output = capsys.readouterr().out
    assert "1 axes, 4 conditions of 20 episodes, 4 to be played" in output
    assert "mass: 1.2, 1.5, 2 times the mass" in output
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
