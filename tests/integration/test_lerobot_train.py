"""LeRobot's own command lines train, resume and evaluate the policies on a generated dataset."""

import json
import shutil
from pathlib import Path

import pytest
from lerobot.configs import PreTrainedConfig
from lerobot.utils.import_utils import register_third_party_plugins
from programs import run
from safetensors.torch import load_file

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

SIZE = 32
KEYFRAMES = "data/keyframes"
# So that 3 steps and 2 more are the same as 5. After a resume of `lerobot-train`, dropout and augmentation go on with
# other random numbers, because LeRobot's loader has drawn one more; `lerobot-bimanual-train` takes that back.
CONSTANT = ["--policy.lr_schedule=constant"]
RANDOM = ["--policy.attention_dropout=0.5", "--policy.augmentation=true"]
NOTHING_RANDOM = ["--policy.attention_dropout=0", "--policy.augmentation=false"]
CAMERA = {"type": "VISUAL", "shape": [3, SIZE, SIZE]}
TINY_ACT = [
    *("--policy.type=act", "--policy.pretrained_backbone_weights=null", "--policy.dim_model=32"),
    *("--policy.n_heads=2", "--policy.dim_feedforward=64", "--policy.n_encoder_layers=1"),
    *("--policy.chunk_size=5", "--policy.n_action_steps=5"),
    "--policy.input_features="
    + json.dumps(
        {f"observation.images.{camera}": CAMERA for camera in ("front", "left_wrist", "right_wrist")}
        | {"observation.state": {"type": "STATE", "shape": [16]}}
    ),
]
POLICIES = Path(__file__).parents[2] / "policies"
CHUNK_ERRORS = POLICIES.parent / "scripts/chunk_errors.py"
SHIPPED = POLICIES.parent / "results/checkpoints/peract2_on_all"


def train(
    *flags, folder: Path, data: str, steps: int, output: str, command="lerobot-train", batch_size=2
) -> None:
    """Train on a dataset in the folder, and keep the last step."""
    paths = (f"--dataset.repo_id=local/{Path(data).name}", f"--dataset.root={data}", f"--output_dir={output}")
    counts = (f"--steps={steps}", f"--save_freq={steps}", f"--batch_size={batch_size}", "--num_workers=0")
    alone = ("--policy.device=cpu", "--policy.push_to_hub=false", "--env_eval_freq=0")
    run(command, *flags, *paths, *counts, *alone, folder=folder)


def evaluate(output: str, folder: Path, *flags: str) -> dict:
    policy = (f"--policy.path={output}/checkpoints/last/pretrained_model", "--policy.device=cpu")
    env = ("--env.type=bimanual", "--env.task=push_box", f"--env.image_size={SIZE}", *flags)
    one = ("--eval.n_episodes=1", "--eval.batch_size=1", f"--output_dir={output}/eval")
    run("lerobot-eval", *policy, *env, *one, folder=folder)
    return json.loads((folder / output / "eval" / "eval_info.json").read_text())["overall"]


def assert_equal_weights(first: Path, second: Path) -> None:
    weights = "checkpoints/last/pretrained_model/model.safetensors"
    one, other = (load_file(folder / weights) for folder in (first, second))
    assert one.keys() == other.keys()
    assert all(one[name].equal(other[name]) for name in one)


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    """A folder with a dataset of two demonstrations in both views."""
    folder = tmp_path_factory.mktemp("two words Ω")
    sizes = ("--task=push_box", "--episodes=2", f"--image_size={SIZE}", "--workers=1")
    run("lerobot-bimanual", "dataset", "generate", *sizes, "--view=both", "--root=data", folder=folder)
    return folder


def keypose_policy_types() -> list[str]:
    """All registered ones."""
    register_third_party_plugins()
    known = PreTrainedConfig.get_known_choices().items()
    return [name for name, config in known if config.__module__.startswith("lerobot_policy_bimanual.")]


@pytest.mark.parametrize("policy", keypose_policy_types())
def test_keypose_policy_trains_and_is_evaluated(room, tiny_flags, policy):
    train(*tiny_flags[policy], folder=room, data=KEYFRAMES, steps=20, output=policy)
    config = json.loads((room / policy / "checkpoints/last/pretrained_model/config.json").read_text())
    meta = room / KEYFRAMES / "meta"
    stats, origin = (json.loads((meta / f"{name}.json").read_text()) for name in ("stats", "bimanual"))
    (most,) = stats["observation.keypose_step"]["max"]
    assert config["keypose_horizon"] == 1 + round(most)
    assert config["trained_instructions"] == ["push the box to the red area"]
    assert config["trained_worlds"] == origin["worlds"]
    assert evaluate(policy, room)["n_episodes"] == 1


@pytest.mark.parametrize(
    ("command", "randomness", "batch_size", "own", "kept"),
    [
        ("lerobot-train", NOTHING_RANDOM, 2, [], ["000003", "000005", "last"]),
        ("lerobot-bimanual-train", RANDOM, 8, ["--keep_last", "1"], ["000005", "last"]),
    ],
)
def test_training_resumes_exactly(room, tiny_flags, command, randomness, batch_size, own, kept):
    """In the first epoch; ours also in later ones, where `lerobot-train` repeats the rows of the first."""
    flags = (*tiny_flags["peract2"], *CONSTANT, *randomness)
    whole, parts = f"{command}-straight", f"{command}-resumed"
    for output, steps in ((whole, 5), (parts, 3)):
        how = {"command": command, "batch_size": batch_size}
        train(*flags, folder=room, data=KEYFRAMES, steps=steps, output=output, **how)
    config = room / parts / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    run(command, f"--config_path={config}", "--resume=true", "--steps=5", *own, folder=room)
    assert_equal_weights(room / whole, room / parts)
    assert sorted(path.name for path in (room / parts / "checkpoints").iterdir()) == kept


@pytest.mark.parametrize(("view", "policy"), [("keyframes", "peract2"), ("frames", "act")])
def test_training_from_memory_gives_the_same_weights(room, tiny_flags, view, policy):
    flags = TINY_ACT if policy == "act" else tiny_flags[policy]
    for command in ("lerobot-train", "lerobot-bimanual-train"):
        output = f"{command}-{policy}"
        train(*flags, folder=room, data=f"data/{view}", steps=3, output=output, command=command)
    assert_equal_weights(room / f"lerobot-train-{policy}", room / f"lerobot-bimanual-train-{policy}")
    if policy == "act":
        assert evaluate("lerobot-bimanual-train-act", room)["n_episodes"] == 1
        last = "lerobot-bimanual-train-act/checkpoints/last/pretrained_model"
        flags = (f"--checkpoint={last}", "--root=data/frames", "--ticks=5")
        assert "keypose arm" in run("python", str(CHUNK_ERRORS), *flags, folder=room)
    weights = (room / f"lerobot-bimanual-train-{policy}").rglob("*.safetensors")
    usual = (room / "data" / view / "meta/info.json").stat().st_mode
    assert {path.stat().st_mode for path in weights} == {usual}


@pytest.mark.weekly
def test_lerobots_diffusion_is_trained_by_its_recipe_and_evaluated(room):
    recipe = POLICIES / "lerobot_policy_bimanual/diffusion/recipes/small.yaml"
    flags = (f"--config_path={recipe}", TINY_ACT[-1], "--policy.down_dims=[32]")
    train(*flags, folder=room, data=KEYFRAMES, steps=1, output="diffusion", command="lerobot-bimanual-train")
    assert evaluate("diffusion", room, "--env.obs=rgb", "--env.control_mode=keypose")["n_episodes"] == 1


@pytest.mark.parametrize("kind", ["smolvla", "peract3"])
@pytest.mark.parametrize("in_a_file", [False, True])
def test_our_evaluation_refuses_a_strangers_checkpoint_on_one_line(kind, in_a_file, tmp_path):
    folder = Path(shutil.copytree(SHIPPED, tmp_path / "strange"))
    config = json.loads((folder / "config.json").read_text()) | {"type": kind}
    (folder / "config.json").write_text(json.dumps(config))
    (tmp_path / "eval.yaml").write_text(json.dumps({"policy": {"path": str(folder)}}))
    policy = "--config_path=eval.yaml" if in_a_file else f"--policy.path={folder}"
    env = ("--env.type=bimanual", "--env.task=lift_ball", "--eval.batch_size=1")
    told = run("lerobot-bimanual-eval", policy, *env, folder=tmp_path, fails=True).splitlines()
    assert "cannot tell whether loading is safe" in told[-1]
    assert len(told) <= 2


@pytest.mark.parametrize(
    ("flag", "said"), [("--stpes=1", "arguments: --stpes=1"), ("--policy.type=peract3", "choice: 'peract3'")]
)
def test_lerobot_refuses_flags_that_it_does_not_know_on_one_line(flag, said, tmp_path):
    words = ("lerobot-bimanual-train", "--dataset.repo_id=local/x", flag)
    told = run(*words, folder=tmp_path, fails=True, fresh=True)
    importing, refusal = told.splitlines()
    assert importing.endswith("importing LeRobot")
    assert said in refusal
