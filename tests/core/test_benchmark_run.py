"""A benchmark whose programs are made up: what was measured at different times is one row, or is refused."""

import json
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import pytest
from made_up_rows import ROW, generation, played, recorded
from rich.console import Console

from lerobot_bimanual.benchmark import run as benchmark
from lerobot_bimanual.benchmark.names import perturbed
from lerobot_bimanual.benchmark.pipeline import Command
from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.reproduction import config_of
from lerobot_bimanual.benchmark.results import BadResult, ResultRow
from lerobot_bimanual.benchmark.training_record import Machine
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, EpisodeKey, Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.record import EvaluationRecord
from lerobot_bimanual.versions import installed_versions

BEFORE, OUTCOMES = "ba9876543210", {"expert": "xxxx", "blind": "x...", "val": ".x", "test": "xx.."}


class Programs:
    """Stand for pipelines: every command leaves what it is told to.

    Attributes:
        worlds: in which demonstrations, expert, blind control and test were made.
        versions: with which demonstrations were made.
        tasks: of the demonstrations.
        failure: of the blind control where it failed.
        leaves_weights: whether a checkpoint holds any.
        tested_with: versions of the test.
    """

    def __init__(self):
        self.worlds: dict[str, str] = defaultdict(lambda: ROW.world)
        self.versions = installed_versions()
        self.tasks = ["lift_ball"]
        self.failure = "fell"
        self.leaves_weights = True
        self.tested_with = installed_versions() | {"torch": "2"}

    def __call__(self, folder: Path, console: Console) -> "Programs":
        return self

    def seconds(self, command: Command) -> float:
        return 1.0

    def run(self, command: Command) -> None:
        flags = dict(word.removeprefix("--").split("=", 1) for word in command.words if "=" in word)
        match command.words[:3]:
            case [_, _, "generate"]:
                self._generate(Path(flags["root"]), flags.get("perturb", ""))
            case [_, _, "evaluate"]:
                self._certify(Path(flags["output"]), flags["control"])
            case ["lerobot-eval", *_]:
                self._evaluate(Path(flags["output_dir"]), flags["env.split"], flags.get("env.perturb", ""))
            case _:
                for step in (2, 4):
                    weights = Path(
                        flags["output_dir"], f"checkpoints/{step:06d}/pretrained_model/model.safetensors"
                    )
                    weights.parent.mkdir(parents=True, exist_ok=True)
                    if self.leaves_weights:
                        weights.write_text(str(step))

    def _generate(self, root: Path, perturb: str) -> None:
        (root / "meta").mkdir(parents=True, exist_ok=True)
        Provenance(
            schema_version=SCHEMA_VERSION,
            view="keyframes",
            versions=self.versions,
            worlds=dict.fromkeys(self.tasks, self.worlds["demonstrations"]),
            settings={},
            command=generation(",".join(self.tasks)) + (f" --perturb={perturb}" if perturb else ""),
            episodes=tuple(
                EpisodeKey(task=task, variation=0, split="train", seed=seed)
                for task in self.tasks
                for seed in (0, 1)
            ),
            skipped=(),
        ).write(root / PROVENANCE_FILE)

    def _certify(self, path: Path, control: str) -> None:
        episodes = [
            vars(episode) | {"task": "lift_ball", "failure": "" if episode.success else self.failure}
            for episode in played(OUTCOMES[control])
        ]
        head = {"control": control, "discretise": 0, "split": "test", "episodes": episodes}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(head | {"worlds": {"lift_ball": self.worlds[control]}}))

    def _evaluate(self, folder: Path, split: str, perturb: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        successes = {"metrics": {"successes": [letter == "x" for letter in OUTCOMES[split]]}}
        (folder / "eval_info.json").write_text(json.dumps({"per_task": [successes]}))
        if split == "test":
            options = {"split": "test", "perturb": perturb}
            world, episodes = self.worlds["test"], recorded(OUTCOMES["test"])
            record = EvaluationRecord(1, "lift_ball", world, options, 2, self.tested_with, episodes)
            record.write(folder / f"{perturbed('lift_ball', perturb)}_test_record.json")


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch, install_recipe) -> Programs:
    install_recipe("mine")
    programs = Programs()
    monkeypatch.setattr(benchmark, "Pipeline", programs)
    return programs


@pytest.fixture
def config(tmp_path: Path) -> BenchmarkConfig:
    return BenchmarkConfig("mine", demos=2, val_episodes=2, test_episodes=4, output=tmp_path)


def run(config: BenchmarkConfig) -> ResultRow:
    plan = Plan.of(config)
    row = benchmark.run(plan, Console(quiet=True))
    assert ResultRow.read(plan.result) == row
    assert plan.result.name == row.file_name
    return row


def test_what_was_measured_in_one_world_is_one_row(programs, config):
    row = run(config)
    assert (row.world, row.checkpoint_step, row.learner) == (ROW.world, 4, "mine")
    assert {who: rate.successes for who, rate in row.rates.items()} == {"policy": 2, "expert": 4, "blind": 1}


def test_a_network_for_a_suite_bears_the_suites_name_though_its_demonstrations_name_every_task(
    programs, config
):
    programs.tasks = ["push_box", "lift_ball"]
    config.trained_on, config.val_episodes = "all", None
    row = run(config)
    assert (row.learner, row.dataset.seeds) == ("mine_on_all", (0, 1))
    assert config_of(row).trained_on == "all"


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (
            "blind",
            r"expert_0_4\.json is of the world 0123456789ab of lift_ball, but .*blind_0_4\.json of ba98",
        ),
        ("demonstrations", r"expert_0_4\.json is of the world 0123456789ab.*keyframes_128_2 of ba9876543210"),
        ("test", r"lift_ball_test_record\.json is of the world ba98.*but the controls in .* are of 0123"),
    ],
)
def test_a_world_that_has_changed_between_the_steps_is_named_with_how_to_go_on(
    what, message, programs, config
):
    programs.worlds[what] = BEFORE
    with pytest.raises(BadResult, match=rf"{message}.*choose another --output, or remove"):
        run(config)


@pytest.mark.parametrize("flag", ["perturb", "demos_perturb"])
def test_a_test_and_demonstrations_of_which_only_one_is_perturbed_are_of_two_worlds(flag, programs, config):
    programs.worlds["demonstrations"] = BEFORE
    setattr(config, flag, "mass:1")
    row = run(config)
    assert (row.world, getattr(config_of(row), flag)) == (ROW.world, "mass:1")


def test_demonstrations_of_other_versions_are_refused_before_anything_learns_from_them(programs, config):
    programs.versions |= {"mujoco": "1.0"}
    with pytest.raises(
        BadResult, match=r"keyframes_128_2 was made with mujoco 1\.0, but .* is installed.*another --output"
    ):
        run(config)
    assert not Plan.of(config).training_folder.exists()


def test_measurements_that_make_no_row_are_refused_in_one_line(programs, config):
    programs.failure = ""
    with pytest.raises(
        BadResult, match=r"does not belong together: field 'blind' is .*choose another --output"
    ):
        run(config)


def test_weights_that_are_gone_are_named(programs, config):
    programs.leaves_weights = False
    with pytest.raises(BimanualError, match=r"model\.safetensors cannot be read \(No such file"):
        run(config)


def test_a_finished_benchmark_that_is_run_again_leaves_its_row_as_it_was(programs, config):
    row = run(config)
    before = replace(row, machine=Machine(99, "another GPU"), date="2026-01-31")
    Plan.of(config).result.write_text(before.to_json())
    assert run(config) == before


def test_a_stopped_benchmark_may_be_run_again_and_not_become_a_full_one(programs, config, tmp_path):
    rival = tmp_path / "rival.json"
    rival.write_text(ROW.to_json())
    stopped = replace(config, stop_when_sure=rival)
    assert run(stopped) == run(stopped)
    with pytest.raises(BimanualError, match=r"stopped against .* is '0f0f.*, but None is asked for"):
        run(config)


def test_a_row_has_the_versions_of_its_test(programs, config):
    programs.tested_with |= {"torch": "1.0"}
    assert run(config).versions["torch"] == "1.0"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"first_seed": 1}, r"tested seeds .* is \[0, 1, 2, 3\], but \[1, 2, 3, 4\] is asked for"),
        ({"test_episodes": 3}, r"tested seeds .*, but \[0, 1, 2\] is asked for"),
        ({"val_episodes": 3}, r"validation episodes .* is 2, but 3 is asked for"),
        ({"train_flags": "--policy.depth=5"}, r"flag --policy\.depth of the training is '3', but '5'"),
        (
            {"eval_flags": "--policy.use_amp=false"},
            r"flag --policy\.use_amp of the test is None, but 'false'",
        ),
        ({"stop_when_sure": Path("rival.json")}, r"stopped against .* is None, but '1f1f1f"),
    ],
)
def test_a_row_of_another_measurement_is_not_replaced(
    changes, message, programs, config, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("rival.json").write_text(replace(ROW, checkpoint_sha256="1f" * 32).to_json())
    plan = Plan.of(config)
    run(config)
    test = plan.evaluation("test", 4)
    marker = {"command": str(test), "inputs": {}, "done": True, "seconds": 1.0}
    (plan.run_folder / f"{test.name}.command.json").write_text(json.dumps(marker))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.json")}
    with pytest.raises(
        BimanualError, match=rf"seed1000\.json would be replaced: its .*{message}.*move the file"
    ):
        run(replace(config, **changes))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.json")} == before
    run(replace(config, eval_flags="--env.video_dir=films"))  # which changes nothing in the row


def test_a_row_that_cannot_be_read_is_not_replaced(programs, config):
    run(config)
    result = Plan.of(config).result
    result.write_text("{")
    with pytest.raises(BadResult, match=r"must be JSON.*choose another --output, or move the file"):
        run(config)
    assert result.read_text() == "{"
