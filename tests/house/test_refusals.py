"""Impossible flags and unwritable outputs are reported on one line, before anything is made or played."""

from dataclasses import fields
from pathlib import Path
from unittest.mock import Mock

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.benchmark.run import count_variations
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import UnwritableOutput, write_file
from lerobot_env_bimanual import eval_program
from lerobot_policy_bimanual.training import program as train_program

BASES = {
    "dataset generate": {"task": "lift_ball", "root": "made"},
    "expert evaluate": {"task": "lift_ball"},
    "policy benchmark": {"output": "made", "dry_run": "true"},
    "policy new": {},
    "policy robustness": {"checkpoint": "nowhere", "task": "lift_ball"},
    "task new": {},
    "task view": {"task": "lift_ball"},
}
"""Flags of commands that could be meant."""
REFUSED = {
    "dataset generate": {
        "task=wash_dishes": "task is 'wash_dishes', but must be one of: ",
        "variation=9": "variation of lift_ball is '9'",
        "cameras=rear": "left_shoulder",
        "cameras=front,front": "none twice",
        "image_size=0": "8 to 4096 pixels",
        "view=frames image_size=33": "'33x33', but must be even sides of at least 16 pixels",
        "workers=-1": "workers is -1",
        "episodes_per_shard=1000000000": "episodes_per_shard",
        "first_seed=9223372036854775808": "first_seed",
        "intermediate=1.5": "intermediate",
        "view=all": "keyframes",
        "perturb=gravity:1": "mass",
        "repo_id=../../elsewhere": "repo_id",
        "root=/ repo_id=local/x": "must be a new folder",
        "root=/proc/dataset": "cannot write /proc/dataset.partial: No such file or directory",
    },
    "expert evaluate": {
        "task=lift_bal": "Did you mean 'lift_ball'?",
        "variation=7": "variation of lift_ball is '7'",
        "episodes=0": "episodes is 0",
        "first_seed=-1": "first_seed is -1",
        "axes=all": "--axes needs --output=FOLDER",
        "levels=3": "axes is (), but must be given with --levels",
        "axes=masse output=made": "axis is 'masse'",
        "axes=mass levels=4 output=made": "levels is 4, but must be one of: 1, 2, 3",
    },
    "policy benchmark": {
        "task=lift_bal": "Did you mean 'lift_ball'?",
        "variation=7": "variation of lift_ball is '7'",
        "demos_variation=0,7": "demos_variation of lift_ball is '7', but must be 'any', or from 0 to 0",
        "trained_on=push_box,lift_tray": "not contain 'lift_ball'; score one of: push_box, lift_tray",
        "task=../../lift_ball": "task is '../../lift_ball', but must be one of: dual_push_buttons",
        "variation=../1": "variation is '../1', but must be an index of up to four digits, or any",
        "trained_on=all variation=0": "variation is 0, but --trained_on=all has demonstrations of any",
        "demos_perturb=mass": "demos_perturb is 'mass', but must be empty, or AXIS:LEVEL",
        "trained_on=all demos_variation=0": "demos_variation is 0, but --trained_on=all has",
        "recipe=missing.yaml": "missing.yaml: No such file or directory",
        "trained_on=all val_episodes=20": "val_episodes is 20, but a network that learned from other tasks",
        "protocol=few eval_flags=--env.max_keyposes=9": "sets --env.max_keyposes, which the protocol few leaves",
        "protocol=few demos=100": "demos is 100, but 20 in the protocol few: leave --demos or --protocol out",
        "recipe=tiny": "recipe is 'tiny', but must be one of: small, paper, FILE.yaml",
        "lanes=0": "lanes is 0",
        "save_freq=0": "save_freq: Input should be greater than or equal to 1, but is 0\n",
        "steps=100000000 save_freq=1": "save_freq must leave at most 10000 checkpoints",
        "train_flags=--steps=3": "sets --steps, which the benchmark sets itself",
        "eval_flags=--policy.depth='3": "a shell could not read",
    },
    "policy robustness": {"checkpoint=nowhere": "no checkpoint at nowhere", "axes=masse": "no checkpoint"},
    "policy new": {"name=act": "'act', which is taken"},
    "task new": {"name=lift_ball": "'lift_ball', which is taken", "name=test": "'test', which is taken"},
    "task view": {
        "task=lift_bal": "Did you mean 'lift_ball'?",
        "variation=7": "variation of lift_ball is '7'",
        "first_seed=-1": "first_seed is -1",
        "checkpoint=nowhere": "no checkpoint at nowhere",
        "perturb=fog:1": "fog",
    },
}
REFUSALS = [(command, *refused) for command, rows in REFUSED.items() for refused in rows.items()]


@pytest.mark.parametrize(("command", "flags", "message"), REFUSALS)
def test_an_invalid_flag_is_refused_on_one_line_and_nothing_is_written(
    command, flags, message, tmp_path, monkeypatch, capsys
):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    given = BASES[command] | dict(flag.split("=", 1) for flag in flags.split())
    words = [f"--{name}={value}" for name, value in given.items()]
    assert cli.main([*command.split(), *words]) in (1, 2)
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


TRAINED = f"--policy.path={Path(__file__).parents[2] / 'results/checkpoints/peract2_on_all'}"
MISTAKES = [
    (eval_program, "", "--policy.path=FOLDER is missing"),
    (eval_program, "--policy.path=nowhere", "no checkpoint at nowhere"),
    (eval_program, "--policy.path=lerobot/act", "act is not a folder, and a checkpoint on the Hub cannot"),
    (
        eval_program,
        f"{TRAINED} --eval.batch_size=0 --env.image_size 3",
        "image_size is 3, but must be 8 to 4096",
    ),
    (eval_program, f"{TRAINED} --env.task=lift_bal", "Did you mean 'lift_ball'?"),
    (eval_program, f"{TRAINED} --env.tsk=lift_ball", "Did you mean '--env.task'?"),
    (eval_program, f"{TRAINED} --env.task=lift_ball --env.variation=9", "variation of lift_ball is '9'"),
    (eval_program, f"{TRAINED} --eval.n_episodes=0", "an integer of at least 1"),
    (train_program, "--policy.type=act --dataset.root=nowhere", "no dataset at nowhere"),
    (train_program, "--policy.type=act", "--dataset.repo_id is missing"),
    (train_program, "--policy.type=act --resume=False --output_dir=.", "there already: choose another"),
    (
        train_program,
        "--resume=true --output_dir=there",
        "from the last checkpoint give --config_path=there/c",
    ),
    (train_program, "--config_path=small.yaml", "small.yaml: No such file or directory"),
    (train_program, "--keep_last=0", "--keep_last is 0, but must be a number of checkpoints, 1 or more"),
    (train_program, "--keep_last=two", "--keep_last is two, but must be a number"),
    (train_program, "--keep_last=", "--keep_last is , but must be a number"),
]


@pytest.mark.parametrize(("program", "flags", "message"), MISTAKES)
def test_a_mistake_for_a_program_of_lerobot_is_told_on_one_line_before_its_import(
    program, flags, message, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_file(tmp_path / "there/checkpoints/last/pretrained_model/train_config.json", "{}")
    monkeypatch.setattr("sys.argv", [program.__name__, *flags.split()])
    assert program.main() in (1, 2)
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1  # before the import there is another line


def test_an_evaluation_that_does_not_fit_the_checkpoint_names_the_flags_of_its_training(monkeypatch, caplog):
    monkeypatch.setattr("lerobot.scripts.lerobot_eval.main", Mock(side_effect=RuntimeError("size mismatch")))
    monkeypatch.setattr("sys.argv", [eval_program.__name__, TRAINED])
    values = {"policy.path": TRAINED.partition("=")[2], "env.type": "bimanual"}
    with pytest.raises(BimanualError, match=r"learned with --env.image_size=128 --env.control_mode=keypose"):
        eval_program._evaluate(values)
    assert "but is scored with --env.image_size=256" in caplog.text


RESULTS = Path(__file__).parents[2] / "results"
CHECKPOINT = f"--checkpoint={RESULTS / 'checkpoints/peract2_on_all'}"
ROWS = f"--results={RESULTS / 'leaderboard'}"
NEEDED = {
    "expert evaluate": ["--task=lift_ball"],
    "policy inspect": [CHECKPOINT, "--root=any"],
    "policy new": ["--name=mine"],
    "policy robustness": [CHECKPOINT, "--task=handover_item_easy"],
    "results diagnose": [ROWS],
    "results report": [ROWS],
    "task new": ["--name=mine"],
    "task view": ["--task=lift_ball"],
}
"""Further flags of a command."""
FLAGS = {name: fields(cli.config_type_of(entry.load())) for name, entry in cli.find_commands().items()}
COMMANDS = [name for name, flags in FLAGS.items() if "output" in {flag.name for flag in flags}]
WORK = (
    "lerobot_env_bimanual.workers.WorkerPool.__init__",
    "lerobot_env_bimanual.world.scene.Scene.__init__",
    "lerobot_policy_bimanual.inspection.loading.load_policy",
    "subprocess.Popen",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_that_cannot_be_written_is_named_before_the_work(command, tmp_path, monkeypatch, capsys):
    count_variations("lift_ball")  # starts a process the first time only, and nothing of `WORK`
    for name in WORK:
        monkeypatch.setattr(name, Mock(side_effect=AssertionError("work has begun")))
    monkeypatch.setattr("lerobot_bimanual.dataset.reader.find_view", lambda *_: None)
    (tmp_path / "file").touch()
    words = [*command.split(), *NEEDED.get(command, []), f"--output={tmp_path / 'file/page.png'}"]
    assert cli.main(words) == 1
    message = capsys.readouterr().err.strip()
    assert message.startswith("lerobot-bimanual: cannot write ")
    assert "\n" not in message
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file"
    write_file(path, "first")
    write_file(path, "second")
    monkeypatch.setattr("os.fsync", Mock(side_effect=OSError(28, "No space left on device")))
    with pytest.raises(UnwritableOutput, match="No space left"):
        write_file(path, "third")
    assert path.read_text() == "second"
    assert list(path.parent.iterdir()) == [path]
