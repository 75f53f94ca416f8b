"""A benchmark with simulated programs: its measurements are one result, or are refused if they disagree."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console
from sample_results import EXPERT, RESULT, WORLD, outcome, proved, provenance

from lerobot_bimanual.benchmark import run as benchmark
from lerobot_bimanual.benchmark.config import BenchmarkConfig, resolve, shortest_config
from lerobot_bimanual.benchmark.pipeline import Command
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, EpisodeKey
from lerobot_bimanual.distributions import installed_versions
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.benchmark import BenchmarkResult, BenchmarkSettings, Machine
from lerobot_bimanual.results.evaluation import with_perturb_suffix
from lerobot_bimanual.results.protocols import PROTOCOLS

OTHER_WORLD = "ba9876543210"
OUTCOMES = {"expert": "xxxx", "replanning": "xxxx", "open_loop": "x...", "val": ".x", "test": "xx.."}


class Programs:
    """Stand for pipelines: every command leaves the files that it is told to."""

    def __init__(self):
        self.worlds: dict[str, str] = defaultdict(lambda: WORLD)  # of demonstrations, expert, open_loop, test
        self.versions, self.tasks = installed_versions(), ["lift_ball"]  # of the demonstrations
        self.tested = OUTCOMES["test"]
        self.ran: list[str] = []  # names of the commands

    def __call__(self, folder: Path, console: Console) -> "Programs":
        return self

    def seconds(self, command: Command) -> float:
        return 1.0

    def run(self, command: Command) -> bool:
        self.ran.append(command.name)
        flags = dict(word.removeprefix("--").split("=", 1) for word in command.words if "=" in word)
        match command.words[:3]:
            case [_, "dataset", "generate"]:
                self._generate(Path(flags["root"]))
            case [_, "expert", "evaluate"]:
                self._report(Path(flags["output"]), flags["player"])
            case ["lerobot-eval", *_]:
                self._evaluate(Path(flags["output_dir"]), flags["env.split"], flags.get("env.perturb", ""))
            case _:
                for step in (2, 4):
                    folder = Path(flags["output_dir"], f"checkpoints/{step:06d}/pretrained_model")
                    folder.mkdir(parents=True, exist_ok=True)
                    (folder / "model.safetensors").write_text(str(step))
        return self.ran.count(command.name) == 1

    def _generate(self, root: Path) -> None:
        (root / "meta").mkdir(parents=True, exist_ok=True)
        provenance(
            "keyframes",
            versions=self.versions,
            worlds=dict.fromkeys(self.tasks, self.worlds["demonstrations"]),
            settings={"tasks": self.tasks, "intermediate": []},
            episodes=tuple(
                EpisodeKey(task=task, variation=0, split="train", seed=seed)
                for task in self.tasks
                for seed in (0, 1)
            ),
        ).write(root / PROVENANCE_FILE)

    def _report(self, path: Path, player: str) -> None:
        solved = [
            outcome(letter == "x", seed, variation=-seed % 3) for seed, letter in enumerate(OUTCOMES[player])
        ]
        report = {"player": player, "n_seeds": len(solved), "versions": {}, "episodes": tuple(solved)}
        EXPERT.model_copy(update=report | {"worlds": {"lift_ball": self.worlds[player]}}).write(path)

    def _evaluate(self, folder: Path, split: str, perturb: str) -> None:
        outcomes = self.tested + "x" if split == "test" else OUTCOMES[split]  # the last one fills up a batch
        record = {
            "world": self.worlds["test"],
            "options": {**RESULT.options, "split": split, "perturb": perturb},
        }
        played = (each.model_copy(update={"variation": -each.seed % 3}) for each in proved(outcomes))
        record |= {"versions": installed_versions() | {"torch": "1.0"}, "episodes": tuple(played)}
        path = folder / f"{with_perturb_suffix('lift_ball', perturb)}_{split}_record.json"
        RESULT.evaluation.model_copy(update=record).write(path)


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch, install_recipe) -> Programs:
    install_recipe("mine")
    programs = Programs()
    monkeypatch.setattr(benchmark, "Pipeline", programs)
    return programs


@pytest.fixture
def config(tmp_path: Path) -> BenchmarkConfig:
    return BenchmarkConfig("mine", demos=2, val_episodes=2, test_episodes=4, output=tmp_path)


def run(config: BenchmarkConfig) -> BenchmarkResult:
    plan = Plan.of(config)
    result = benchmark.run(plan, Console(quiet=True))
    assert BenchmarkResult.read(plan.result) == result
    assert result.config == plan.settings
    return result


def test_measurements_in_one_world_are_one_result_and_are_not_made_again(programs, config):
    result = run(config)
    assert (result.world, result.checkpoint_step, result.config.policy_id) == (WORLD, 4, "mine")
    solved = {who: rate.successes for who, rate in result.rates.items()}
    assert solved == {"policy": 2, "expert": 4, "open_loop": 1}
    assert result.versions["torch"] == "1.0"
    assert result.demonstrations.settings == {"tasks": ["lift_ball"], "intermediate": []}
    programs.ran.clear()
    assert run(replace(config, video_dir=Path("videos"))) == result
    assert not programs.ran


def test_a_policy_trained_on_a_suite_is_named_after_the_suite_and_not_after_its_tasks(programs, config):
    programs.tasks = ["push_box", "lift_ball"]
    config.trained_on, config.val_episodes = "all", None
    result = run(config)
    assert (result.config.policy_id, result.demonstrations.seeds) == ("mine_on_all", (0, 1))
    assert shortest_config(result.config).trained_on == "all"


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("open_loop", r"open_loop_0_4\.json is from world ba98.* of lift_ball, .*expert_0_4\.json .* 0123"),
        ("demonstrations", r"keyframes_128_2 is from world ba98.*expert_0_4\.json .* 0123456789ab"),
        ("test", r"lift_ball_test_record\.json is from world ba98.*expert_0_4\.json .* 0123456789ab"),
    ],
)
def test_a_world_that_changed_between_the_steps_is_named_with_a_remedy(what, message, programs, config):
    programs.worlds[what] = OTHER_WORLD
    with pytest.raises(BimanualError, match=rf"{message}.*choose another --output, or remove"):
        run(config)


@pytest.mark.parametrize("flag", ["perturb", "demos_perturb"])
def test_worlds_may_differ_if_only_the_test_or_only_the_demonstrations_are_perturbed(flag, programs, config):
    programs.worlds["demonstrations"] = OTHER_WORLD
    setattr(config, flag, "mass:1")
    result = run(config)
    assert (result.world, getattr(result.config, flag)) == (WORLD, "mass:1")


def test_a_result_names_the_machine_of_its_training(programs, config, monkeypatch):
    monkeypatch.setattr(Machine, "this", lambda device: Machine(cpus=2, gpu="one"))
    assert run(config).machine.gpu == "one"
    monkeypatch.setattr(Machine, "this", lambda device: Machine(cpus=7))
    assert run(replace(config, perturb="mass:1")).machine.gpu == "one"  # the same training


def test_demonstrations_by_several_plans_have_names_of_their_own(programs, config):
    plan = Plan.of(replace(config, demos_plans="several"))
    assert "--plans=several" in plan.generation().words
    assert plan.dataset.name == "keyframes_128_2_plans"
    assert plan.result.name == "lift_ball_mine_small_seed1000_plans.json"
    assert not any("plans" in word for word in Plan.of(config).generation().words)


def test_trainings_on_demonstrations_of_other_seeds_share_protocol_and_baselines(programs, config):
    usual, other = Plan.of(config), Plan.of(replace(config, first_demo_seed=2000))
    assert "--first_seed=2000" in other.generation().words
    assert "--first_seed=2000" not in usual.generation().words
    assert other.dataset.name == "keyframes_128_2_from2000"
    assert other.result.name == "lift_ball_mine_small_seed1000_from2000.json"
    assert (other.settings.policy_id, other.settings.protocol) == ("mine", "own")
    assert other.baseline("expert") == usual.baseline("expert")


def task_of(protocol: str) -> str:
    return "dual_push_buttons" if protocol == "pairings" else "lift_ball"


def test_every_protocol_is_one_flag_and_no_other_contradicts_it(programs):
    for name, protocol in PROTOCOLS.items():
        config = BenchmarkConfig("mine", task=task_of(name), protocol=name)
        settings = resolve(config)
        flags = protocol.flags(config.task)
        assert settings.protocol == name
        assert flags.items() <= vars(settings).items()
        assert (
            resolve(replace(config, **flags)) == settings == resolve(replace(config, protocol="own", **flags))
        )
        assert f'"protocol": "{name}"' in settings.to_json()
        if name != "own":
            with pytest.raises(BimanualError, match=f"setting is .* in the protocol {name}: leave --setting"):
                resolve(replace(config, setting="standard" if name == "varied" else "varied"))
    with pytest.raises(BimanualError, match="task of the protocol pairings is 'lift_ball'"):
        resolve(BenchmarkConfig("mine", protocol="pairings"))
    with pytest.raises(
        BimanualError, match="task of the protocol standard is 'stack', but must be one of: dual_push"
    ):
        resolve(BenchmarkConfig("mine", task="stack", protocol="standard"))
    assert resolve(BenchmarkConfig("mine", task="stack", first_seed=4_000_000)).protocol == "own"
    with pytest.raises(BimanualError, match="protocol is 'few', but its flags are those of 'own'"):
        BenchmarkSettings.of(**dict(resolve(BenchmarkConfig("mine"))) | {"protocol": "few"})


def test_settings_that_a_benchmark_would_ignore_or_misread_are_refused(
    programs, config, install_recipe, tmp_path
):
    with pytest.raises(BimanualError, match=r"mine/paper\.yaml has the name of an installed recipe"):
        resolve(replace(config, recipe="mine/paper.yaml"))
    with pytest.raises(BimanualError, match=r"--keep_last, but every checkpoint is validated.*val_episodes="):
        resolve(replace(config, train_flags="--keep_last=1"))
    assert resolve(replace(config, train_flags="--keep_last=1", val_episodes=0)).training["keep_last"] == 1
    text = install_recipe("theirs").read_text().replace("dataset: {", "seed: 7\ndataset: {episodes: [0], ")
    (own := tmp_path / "own.yaml").write_text(text)
    with pytest.raises(
        BimanualError, match=r"own\.yaml sets dataset\.episodes, seed, which a benchmark sets"
    ):
        resolve(BenchmarkConfig("theirs", recipe=str(own)))
    with pytest.raises(BimanualError, match=r"file would have a name of 2\d\d letters"):
        resolve(replace(config, trained_on="a" * 200, val_episodes=0))


def test_protocols_that_differ_in_the_test_alone_share_demonstrations_and_training(programs):
    plans = {name: Plan.of(BenchmarkConfig("mine", task=task_of(name), protocol=name)) for name in PROTOCOLS}
    standard, hard = plans.pop("standard"), plans.pop("hard")
    assert hard.generation() == standard.generation() == plans["own"].generation()
    assert hard.training() == standard.training() == plans.pop("own").training()
    assert hard.evaluation("val", 2) == standard.evaluation("val", 2) != hard.evaluation("test", 2)
    assert len({plan.dataset for plan in (standard, *plans.values())}) == len(plans) + 1
    assert len({plan.run_folder for plan in (standard, *plans.values())}) == len(plans) + 1
    assert "--variation=0,1,2,3" in plans["pairings"].generation().words
    assert "--player=replanning" in hard.baseline("expert").words


def test_recipes_with_other_cameras_have_demonstrations_of_their_own(
    programs, config, tmp_path, install_recipe
):
    features = "input_features: {observation.images.front_depth: {type: VISUAL, shape: [1, 9, 9]}}"
    text = install_recipe("theirs").read_text().replace("name: plain", features)
    (file := tmp_path / "front.yaml").write_text(text)
    plan = Plan.of(replace(config, policy="theirs", recipe=str(file)))
    assert "--cameras=front" in plan.generation().words
    assert (plan.dataset.name, Plan.of(config).dataset.name) == ("keyframes_front_128_2", "keyframes_128_2")


def test_demonstrations_of_other_versions_are_refused_before_a_policy_learns_from_them(programs, config):
    programs.versions |= {"mujoco": "1.0"}
    with pytest.raises(BimanualError, match=r"_128_2 was made with mujoco 1\.0, but .*another --output"):
        run(config)
    assert not Plan.of(config).training_folder.exists()


def test_an_evaluation_that_lacks_an_episode_is_refused(programs, config):
    programs.tested = "xx"
    with pytest.raises(BimanualError, match=r"do not belong together: .*must be on the 4 seeds from 0 on"):
        run(config)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"first_seed": 1}, "first_seed is 0, not 1"),
        ({"train_flags": "--policy.depth=5"}, r"training is .*'policy\.depth': 3.*not .*'policy\.depth': 5"),
        ({"eval_flags": "--policy.use_amp=false"}, r"evaluation is {}, not {'policy\.use_amp': False}"),
    ],
)
def test_the_result_of_another_measurement_is_not_replaced(changes, message, programs, config, tmp_path):
    run(config)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.json")}
    programs.ran.clear()
    with pytest.raises(BimanualError, match=rf"seed1000\.json would be replaced: its {message}.*--output"):
        run(replace(config, **changes))
    assert not programs.ran
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.json")} == before
    Plan.of(config).result.write_text("{")
    with pytest.raises(BimanualError, match=r"Invalid JSON.*choose another --output, or move the file"):
        run(config)
