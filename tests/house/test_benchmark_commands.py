"""What a benchmark would run: every command is valid, and the best checkpoint is the right one."""

import re
import shlex
from dataclasses import fields

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.benchmark.episode_result import EpisodeResult, Validation, best_checkpoint
from lerobot_bimanual.benchmark.flag_text import further_flags
from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.protocol import PROTOCOLS
from lerobot_bimanual.cli.flags import flags_of, parse_flags
from lerobot_bimanual.commands.demo import DemoConfig, demo
from lerobot_bimanual.commands.policy_benchmark import policy_benchmark
from lerobot_bimanual.errors import BimanualError

POLICIES = ("act", "peract2", "peract_independent", "peract_lf", "rvt_lf")


def check(words: list[str]) -> None:
    """Parse a command as its program would."""
    import draccus
    from lerobot.configs.eval import EvalPipelineConfig
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the environment

    program, *flags = words
    if program == "lerobot-bimanual":
        name, flags = cli.find_command(flags)
        parse_flags(cli.config_type_of(cli.find_commands()[name].load()), flags)
        return
    config_type = EvalPipelineConfig if program == "lerobot-eval" else TrainPipelineConfig
    if any(flag.startswith("--policy.path=") for flag in flags):
        # LeRobot reads the policy's config from there and applies the other --policy flags to it.
        flags = [flag for flag in flags if not flag.startswith("--policy.")]
    draccus.parse(config_type, args=flags, exit_on_error=False)


def commands_of(config: BenchmarkConfig) -> list[list[str]]:
    """Words of every command, when the last checkpoint is the best."""
    plan = Plan.of(config)
    return [command.words for command in plan.commands(plan.checkpoint_steps[-1])]


@pytest.mark.parametrize(
    ("policy", "recipe"), [*((policy, "small") for policy in POLICIES), ("act", "paper")]
)
def test_the_commands_of_a_benchmark_are_valid(policy, recipe, tmp_path):
    output = tmp_path / "a folder"
    commands = commands_of(BenchmarkConfig(policy=policy, recipe=recipe, device="cpu", output=output))
    assert not output.exists()
    checkpoints = 10 if recipe == "paper" else 3 if policy == "act" else 2
    programs = [words[0] for words in commands]
    assert programs == ["lerobot-bimanual"] * 3 + ["lerobot-bimanual-train"] + ["lerobot-eval"] * (
        checkpoints + 1
    )
    *ours, training, first_evaluation = commands[:5]
    for words in (*ours, training, first_evaluation):  # the other evaluations have the same flags
        check(words)
    splits = [word for words in commands for word in words if word.startswith("--env.split=")]
    assert splits == ["--env.split=val"] * checkpoints + ["--env.split=test"]


@pytest.mark.parametrize("policy", POLICIES)
def test_depth_is_recorded_and_rendered_only_for_policies_that_read_it(policy, tmp_path):
    config = BenchmarkConfig(policy=policy, output=tmp_path)
    generation, *_, evaluation = commands_of(config)
    without = policy == "act"
    assert ("--depth=false" in generation) == without
    assert ("--env.obs=rgb" in evaluation) == without
    # Demonstrations are shared by the policies of a task, but not by one that needs what is not in them.
    assert ("_rgb_" in Plan.of(config).dataset.name) == without


def test_the_demo_is_a_benchmark_of_one_checkpoint_with_films(tmp_path):
    config = DemoConfig(output=tmp_path / "a folder")
    commands = commands_of(config.benchmark())
    for words in commands:
        check(words)
    assert [words[0] for words in commands][3:] == ["lerobot-bimanual-train", "lerobot-eval"]
    assert f"--env.video_dir={config.films}" in commands[-1]
    assert "--env.split=test" in commands[-1]


def test_flags_of_the_demo_mean_what_they_mean_for_a_benchmark(tmp_path):
    config = DemoConfig(output=tmp_path, demos=2, test_episodes=3, first_seed=4)
    as_benchmark = config.benchmark()
    shared = {field.name for field in fields(DemoConfig)} - {"videos"}
    assert all(getattr(as_benchmark, name) == getattr(config, name) for name in shared)


def test_a_dry_run_prints_and_runs_nothing(tmp_path, capsys):
    policy_benchmark(BenchmarkConfig(output=tmp_path / "output", dry_run=True))
    printed = capsys.readouterr().out.splitlines()
    commands = commands_of(BenchmarkConfig(output=tmp_path / "output"))
    assert [shlex.split(line) for line in printed if not line.startswith("#")] == commands
    assert not (tmp_path / "output").exists()


@pytest.mark.parametrize(
    ("task", "variation", "message"),
    [
        (
            "symmetric",
            "any",
            "'symmetric', a suite, but a benchmark is of one task; run one for each of: dual_push",
        ),
        (
            "lift_bal",
            "any",
            "unknown task 'lift_bal'. Did you mean 'lift_ball'[?] Tasks and suites: .*push_box",
        ),
        ("lift_ball", "7", "task 'lift_ball' has no variation '7'"),
    ],
)
def test_what_is_no_task_of_the_environment_is_refused_before_anything_runs(
    task, variation, message, tmp_path
):
    output = tmp_path / "output"
    with pytest.raises(BimanualError, match=message):
        policy_benchmark(BenchmarkConfig(task=task, variation=variation, output=output, dry_run=True))
    assert not output.exists()


def test_a_network_must_have_learned_from_the_task_that_is_scored(tmp_path):
    config = BenchmarkConfig(task="lift_ball", trained_on="push_box,lift_tray", output=tmp_path, dry_run=True)
    with pytest.raises(
        BimanualError, match=r"of which 'lift_ball' is none.*score one of: push_box, lift_tray"
    ):
        policy_benchmark(config)


def test_the_demo_refuses_a_suite_too(tmp_path):
    with pytest.raises(BimanualError, match="a suite"):
        demo(DemoConfig(task="symmetric", output=tmp_path / "output"))
    assert not (tmp_path / "output").exists()


def test_numbers_that_are_given_win_over_recipe_and_protocol():
    plan = Plan.of(BenchmarkConfig(steps=7, image_size=32, policy="act"))
    assert (plan.recipe.steps, plan.recipe.batch_size, plan.protocol.image_size) == (7, 8, 32)
    assert plan.training_flags()["steps"] == "7"
    assert "[3, 32, 32]" in plan.training_flags()["policy.input_features"]


@pytest.mark.parametrize(
    ("steps", "save_freq", "checkpoints"), [(4, 2, (2, 4)), (5, 2, (2, 4, 5)), (4, 9, (4,)), (4, 4, (4,))]
)
def test_the_last_step_leaves_a_checkpoint_too(steps, save_freq, checkpoints):
    assert Plan.of(BenchmarkConfig(steps=steps, save_freq=save_freq)).checkpoint_steps == checkpoints


def test_without_validation_there_must_be_nothing_to_choose():
    assert Plan.of(BenchmarkConfig(steps=4, save_freq=4, val_episodes=0)).checkpoint_steps == (4,)
    with pytest.raises(
        BimanualError, match=r"val_episodes is 0.* after 2, 4 steps; leave one with --save_freq=4"
    ):
        Plan.of(BenchmarkConfig(steps=4, save_freq=2, val_episodes=0))


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


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"task": "lift_ball,push_box"}, "is 'lift_ball,push_box', but a benchmark is of one task"),
        ({"task": "../../lift_ball"}, "is '../../lift_ball', but a benchmark is of one task"),
        ({"variation": "../1"}, "variation is '../1', but must be an index of up to four digits, or any"),
        ({"policy": "../act"}, "policy is '../act', but must be one of: act, peract2"),
        ({"trained_on": "../all"}, "trained_on is '../all', but must be tasks and suites"),
        ({"variation": "7" * 5000}, "variation is '777"),
        ({"recipe": "../small"}, "recipe for peract2 is '../small', but must be one of: paper, small"),
    ],
)
def test_names_that_would_leave_the_folder_are_refused(names, message):
    with pytest.raises(BimanualError, match=re.escape(message)):
        Plan.of(BenchmarkConfig(**names))


def test_benchmarks_of_several_tasks_share_one_network_and_nothing_else():
    one, other = (
        Plan.of(BenchmarkConfig(task=task, trained_on="lift_ball,push_box", first_seed=7))
        for task in ("lift_ball", "push_box")
    )
    alone = Plan.of(BenchmarkConfig(task="push_box", trained_on="push_box"))

    assert one.generation() == other.generation()
    assert one.training() == other.training()
    assert "--task=lift_ball,push_box" in one.generation().words
    *_, last = one.checkpoint_steps
    assert len(one.commands(last)) == 5  # no validation
    assert one.run_folder != other.run_folder
    assert one.result.name == "lift_ball_peract2_small_seed1000_on_lift_ball.push_box.json"
    assert alone == Plan.of(BenchmarkConfig(task="push_box"))


@pytest.mark.parametrize(
    ("also", "message"),
    [
        ({"variation": "0"}, "variation is 0, but --trained_on=all has demonstrations of any"),
        ({"val_episodes": 20}, "val_episodes is 20, but of a network for several tasks"),
    ],
)
def test_what_does_not_go_with_a_network_for_several_tasks_is_refused(also, message):
    with pytest.raises(BimanualError, match=re.escape(message)):
        Plan.of(BenchmarkConfig(trained_on="all", **also))


@pytest.mark.parametrize(
    ("number", "message"),
    [
        ({"save_freq": 0}, "save_freq is 0, but must be from 1 to 999999999"),
        ({"steps": 10**9}, "steps is 1000000000, but must be from 1 to 999999999"),
        ({"seed": 10**9}, "seed is 1000000000, but must be from 0 to 999999999"),
        ({"seed": -1}, "seed is -1, but must be from 0"),
        ({"first_seed": -1}, "first_seed is -1, but must be from 0"),
        ({"first_seed": 2**32}, "first_seed is 4294967296, but must be from 0 to 4294967295"),
    ],
)
def test_numbers_that_no_row_could_hold_are_refused_before_anything_runs(number, message):
    with pytest.raises(BimanualError, match=message):
        Plan.of(BenchmarkConfig(**number))


def test_a_variation_has_one_name():
    assert Plan.of(BenchmarkConfig(variation="00")) == Plan.of(BenchmarkConfig(variation="0"))


def test_a_recipe_is_one_of_those_with_a_protocol():
    (flag,) = (flag for flag in flags_of(BenchmarkConfig) if flag.name == "recipe")
    assert flag.value_name == "|".join(PROTOCOLS)
    with pytest.raises(BimanualError, match=r"tiny.*small.*paper"):
        parse_flags(BenchmarkConfig, ["--recipe=tiny"])


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
