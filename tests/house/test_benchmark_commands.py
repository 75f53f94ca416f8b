"""What a benchmark would run: every command is valid, and flags that cannot be meant are refused before anything runs."""

import shlex
import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import pytest
from documents import parse

from lerobot_bimanual.benchmark import column
from lerobot_bimanual.benchmark.config import BenchmarkConfig, resolve
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.recipes import SIZES
from lerobot_bimanual.commands.policy_benchmark import policy_benchmark
from lerobot_bimanual.commands.policy_recipes import RecipesConfig, policy_recipes
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.statistics import SuccessRate

STOCK = {"act", "diffusion"}
POLICIES = (*sorted(STOCK), "peract2", "peract_independent", "peract_lf", "rvt_lf")


def commands_of(config: BenchmarkConfig) -> list[list[str]]:
    """Words of every command, when the last checkpoint is the best."""
    plan = Plan.of(config)
    return [command.words for command in plan.commands(plan.settings.steps)]


@pytest.mark.parametrize(
    ("policy", "recipe"), [*((each, "small") for each in POLICIES), ("act", "paper"), ("rvt_lf", "paper")]
)
def test_the_commands_of_a_benchmark_are_valid(policy: str, recipe, tmp_path: Path):
    output = tmp_path / "a folder"
    config = BenchmarkConfig(policy=policy, recipe=recipe, device="cpu", output=output)
    commands = commands_of(config)
    assert not output.exists()
    is_stock = policy in STOCK
    checkpoints = 10 if recipe == "paper" else 0
    programs = [words[0] for words in commands]
    evaluations = ["lerobot-eval"] * (checkpoints + 1)
    assert programs == ["lerobot-bimanual"] * 3 + ["lerobot-bimanual-train"] + evaluations
    for words in commands[0 if is_stock else 3 : 5]:  # other evaluations have the same flags
        parse(*words)
    splits = [word for words in commands for word in words if word.startswith("--env.split=")]
    assert splits == ["--env.split=val"] * checkpoints + ["--env.split=test"]
    # Demonstrations are shared by the policies of a task, but not by one that needs what is not in them.
    assert ("--depth=false" in commands[2]) == is_stock
    assert ("--env.obs=rgb" in commands[-1]) == is_stock
    assert ("--env.control_mode=keypose" in commands[-1]) == (policy == "diffusion")
    assert ("_rgb_" in Plan.of(config).dataset.name) == is_stock


def test_a_dry_run_prints_and_runs_nothing(tmp_path: Path, capsys):
    policy_benchmark(BenchmarkConfig(output=tmp_path / "output", dry_run=True))
    printed = capsys.readouterr().out.splitlines()
    commands = commands_of(BenchmarkConfig(output=tmp_path / "output"))
    assert [shlex.split(line) for line in printed if not line.startswith("#")] == commands
    assert Path(printed[0].removeprefix("# recipe: ")).is_file()
    assert not (tmp_path / "output").exists()


def test_a_benchmark_that_fails_does_not_stop_those_of_other_policies_and_tasks(tmp_path, monkeypatch):
    started, running = [], []

    def start(words, log):
        started.append(words)
        program = f"raise SystemExit({len(running) == 1})"
        running.append(subprocess.Popen([sys.executable, "-c", program], stdout=log))
        return running[-1]

    monkeypatch.setattr(column, "start", start)
    result = SimpleNamespace(rates={"policy": SuccessRate(48, 50)})
    monkeypatch.setattr(column.BenchmarkResult, "read", lambda _: result)
    config = BenchmarkConfig("peract2,rvt_lf", "lift_ball,push_box", lanes=2, output=tmp_path)
    asked = column.cells(config, ["lift_ball", "push_box"])
    with pytest.raises(BimanualError, match=r"1 of 4 failed; .*logs/push_box_peract2_small_seed1000.log"):
        column.run_column(asked, lanes=2)
    assert [words[3:5] for words in started[:2]] == [
        ["--policy=peract2", "--task=lift_ball"],
        ["--policy=peract2", "--task=push_box"],  # no lane waits for the dataset of another
    ]
    assert len(started) == len([*(tmp_path / "logs").iterdir()]) == 4
    shared = column.cells(replace(config, policy="peract2", protocol="multitask"), ["lift_ball", "push_box"])
    assert [cell.workers for cell in shared] == [0, 0]  # in one lane, which has all cores


def test_numbers_and_further_flags_that_are_given_win_over_recipe_and_protocol():
    flags = "--policy.n_heads=1 --policy.tags='[\"a b\"]'"
    settings = resolve(BenchmarkConfig(steps=7, image_size=64, policy="act", train_flags=flags))
    assert (settings.steps, settings.batch_size, settings.image_size) == (7, 32, 64)
    assert (settings.training["policy.n_heads"], settings.training["policy.tags"]) == (1, ["a b"])
    assert "[3, 64, 64]" in str(settings.training["policy.input_features"])


@pytest.mark.parametrize(
    ("steps", "save_freq", "checkpoints"), [(4, 2, (2, 4)), (5, 2, (2, 4, 5)), (4, 9, (4,)), (4, 4, (4,))]
)
def test_the_last_step_leaves_a_checkpoint_too(steps: int, save_freq: int, checkpoints: tuple[int, ...]):
    assert resolve(BenchmarkConfig(steps=steps, save_freq=save_freq)).checkpoint_steps == checkpoints


def test_benchmarks_of_several_tasks_share_one_network_and_nothing_else():
    shared = {"trained_on": "lift_ball,push_box", "first_seed": 7}
    one, other = (Plan.of(BenchmarkConfig(task=task, **shared)) for task in ("lift_ball", "push_box"))
    assert one.generation() == other.generation()
    assert one.training() == other.training()
    assert "--task=lift_ball,push_box" in one.generation().words
    assert len([*one.commands(one.settings.steps)]) == 5  # no validation
    assert one.run_folder != other.run_folder
    assert one.result.name == "lift_ball_peract2_small_seed1000_on_lift_ball.push_box.json"
    alone = Plan.of(BenchmarkConfig(task="push_box", trained_on="push_box"))
    assert alone == Plan.of(BenchmarkConfig(task="push_box"))


PACKAGES = Path(__file__).parents[2] / "policies" / "lerobot_policy_bimanual"
FILES = sorted(PACKAGES.glob("*/recipes/*.yaml"))


@pytest.mark.parametrize("folder", ["runs #1", "runs: all"])
def test_places_that_lerobot_would_cut_are_refused_before_anything_runs(folder, tmp_path):
    for name in ("output", "video_dir"):
        with pytest.raises(
            BimanualError, match=f"{name} is .*{folder}.* but must be a path without ' #' and ': '"
        ):
            policy_benchmark(BenchmarkConfig(**{name: tmp_path / folder}))
    assert not [*tmp_path.iterdir()]


def test_every_policy_has_a_recipe_of_every_size():
    policies = {path.parent.name for path in PACKAGES.glob("*/configuration_*.py")}
    assert {(path.parts[-3], path.stem) for path in FILES} == {*product(policies | STOCK, SIZES)}


def test_all_recipes_are_listed_with_their_files(capsys, monkeypatch):
    policy_recipes(RecipesConfig())
    printed = capsys.readouterr().out.split()
    assert {word for word in printed if word.endswith(".yaml")} == set(map(str, FILES))
    monkeypatch.setattr("lerobot_bimanual.commands.policy_recipes.entries", lambda _: {})
    with pytest.raises(BimanualError, match="no recipes are installed"):
        policy_recipes(RecipesConfig())


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_stock_training_reads_a_recipe_and_a_benchmark_trains_it(path: Path):
    from lerobot.configs.train import TrainPipelineConfig

    planned = parse(*Plan.of(BenchmarkConfig(policy=path.parts[-3], recipe=path.stem)).training().words)
    read = TrainPipelineConfig.from_pretrained(path, cli_args=[])
    for name in ("policy", "steps", "batch_size", "save_freq"):
        assert getattr(planned, name) == getattr(read, name)
    read.validate()
