"""What a benchmark would run: every command is valid, and the best checkpoint is the right one."""

import shlex
from typing import get_args

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan, further_flags
from lerobot_bimanual.benchmark.recipe import SMALL_FLAGS, PolicyName
from lerobot_bimanual.benchmark.results import EpisodeResult, Validation
from lerobot_bimanual.benchmark.run import best_checkpoint, checkpoint_steps
from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.commands.benchmark import benchmark
from lerobot_bimanual.commands.demo import DemoConfig, stages
from lerobot_bimanual.errors import BimanualError

POLICIES = get_args(PolicyName)


def test_every_policy_has_a_recipe():
    assert set(POLICIES) == set(SMALL_FLAGS)


def check(words: list[str]) -> None:
    """Parse a command as its program would."""
    import draccus
    from lerobot.configs.eval import EvalPipelineConfig
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the environment

    program, *flags = words
    if program == "lerobot-bimanual":
        verb, *flags = flags
        parse_flags(cli.config_type_of(cli.find_verbs()[verb].load()), flags)
        return
    config_type = EvalPipelineConfig if program == "lerobot-eval" else TrainPipelineConfig
    if any(flag.startswith("--policy.path=") for flag in flags):
        # LeRobot reads the policy's config from there and applies the other --policy flags to it.
        flags = [flag for flag in flags if not flag.startswith("--policy.")]
    draccus.parse(config_type, args=flags, exit_on_error=False)


@pytest.mark.parametrize(
    ("policy", "recipe"), [*((policy, "small") for policy in POLICIES), ("act", "paper")]
)
def test_a_dry_run_prints_valid_commands_and_runs_nothing(policy, recipe, tmp_path, capsys):
    output = tmp_path / "a folder"
    benchmark(BenchmarkConfig(policy=policy, recipe=recipe, device="cpu", output=output, dry_run=True))
    assert not output.exists()
    commands = [shlex.split(line, comments=True) for line in capsys.readouterr().out.splitlines()]
    commands = [words for words in commands if words]
    checkpoints = 2 if recipe == "small" else 10
    programs = [words[0] for words in commands]
    trains = "lerobot-train" if policy == "act" else "lerobot-bimanual-train"
    assert programs == ["lerobot-bimanual"] * 3 + [trains] + ["lerobot-eval"] * (checkpoints + 1)
    *ours, training, first_evaluation = commands[:5]
    for words in (*ours, training, first_evaluation):  # the other evaluations have the same flags
        check(words)
    splits = [word for words in commands for word in words if word.startswith("--env.split=")]
    assert splits == ["--env.split=val"] * checkpoints + ["--env.split=test"]


def test_the_commands_of_the_demo_are_valid(tmp_path):
    for stage in stages(DemoConfig(), tmp_path):
        check(stage.command)


def test_numbers_that_are_given_win_over_the_recipe():
    plan = Plan.of(BenchmarkConfig(steps=7, image_size=32, policy="act"))
    assert (plan.recipe.steps, plan.recipe.batch_size) == (7, 8)
    assert plan.training_flags()["steps"] == "7"
    assert "[3, 32, 32]" in plan.training_flags()["policy.input_features"]


def test_further_flags_win_over_the_recipe():
    flags = Plan.of(
        BenchmarkConfig(train_flags="--policy.depth=1 --policy.tags='[\"a b\"]'")
    ).training_flags()
    assert (flags["policy.depth"], flags["policy.tags"]) == ("1", '["a b"]')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("--steps=3", "sets --steps, which the benchmark sets itself"),
        ("--policy.depth 3", "holds '--policy.depth', but must hold flags of the form --name=value"),
        ("depth=3", "holds 'depth=3'"),
        ("--policy.depth='3", "no shell could read"),
    ],
)
def test_further_flags_that_cannot_be_meant_are_refused(text, message):
    with pytest.raises(BimanualError, match=message):
        further_flags("train_flags", text, own=("steps",))


def test_a_benchmark_is_of_one_task():
    with pytest.raises(BimanualError, match="one task"):
        Plan.of(BenchmarkConfig(task="lift_ball,push_box"))


def test_numbers_below_one_are_refused():
    with pytest.raises(BimanualError, match="save_freq is 0, but must be at least 1"):
        Plan.of(BenchmarkConfig(save_freq=0))


def test_results_of_different_benchmarks_lie_apart():
    variants = [
        {},
        {"policy": "act"},
        {"task": "push_box"},
        {"variation": "0"},
        {"recipe": "paper"},
        {"seed": 1},
    ]
    plans = [Plan.of(BenchmarkConfig(**variant)) for variant in variants]
    assert len({plan.result for plan in plans}) == len({plan.run_folder for plan in plans}) == len(plans)


def validation(step: int, outcomes: str) -> Validation:
    return Validation(
        step, tuple(EpisodeResult(seed, outcome == "x") for seed, outcome in enumerate(outcomes))
    )


def test_the_best_checkpoint_solves_most_and_of_equals_is_the_latest():
    validations = [validation(1000, "xx.."), validation(300, "..xx"), validation(2000, "...x")]
    assert best_checkpoint(validations).step == 1000
    assert best_checkpoint([*validations, validation(100, "xxx.")]).step == 100


def test_checkpoints_are_found_by_their_steps(tmp_path):
    for name in ("000250", "1000000", "000500", "last"):
        (tmp_path / name).mkdir()
    assert checkpoint_steps(tmp_path) == [250, 500, 1_000_000]
