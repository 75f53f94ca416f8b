"""LeRobot's programs for robots do what docs/robot.md says: its commands, in order, with less of everything."""

import logging
import os
import pty
import re
import runpy
import shlex
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import draccus
import grpc
import numpy as np
import pytest
from lerobot.configs.train import TrainPipelineConfig  # noqa: F401  before plugins ask for it
from lerobot.datasets import LeRobotDataset

from lerobot_bimanual import cli
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.joint_action import CONTROL_HZ, by_arm
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual.bimanual_sim import BimanualSim
from lerobot_robot_bimanual.leaders import BimanualKeyboard

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

PAGE = Path(__file__).parents[2] / "docs/robot.md"
SMALL = ("--robot.image_size=32", "--robot.calibration_dir=calibration")
TINY_ACT = (
    *("--policy.device=cpu", "--policy.pretrained_backbone_weights=null", "--policy.dim_model=32"),
    *("--policy.n_heads=2", "--policy.dim_feedforward=64", "--policy.n_encoder_layers=1"),
    *("--policy.chunk_size=5", "--policy.n_action_steps=5", "--policy.temporal_ensemble_coeff=null"),
    *("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0"),
)


def page_command(program: str, word: str = "") -> list[str]:
    """The words after a program's name, in its one call on the page; of several calls in that which has a word."""
    blocks = re.findall(r"```bash\n(.*?)```", PAGE.read_text(), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    calls = [shlex.split(line.removesuffix("&")) for line in lines if line.startswith(program + " ")]
    (words,) = [words for words in calls if not word or word in words]
    return words[len(program.split()) :]


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Iterator[Path]:
    """A working directory of its own; LeRobot's logging and signal handlers are put back at the end."""
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    kept, handlers = {number: signal.getsignal(number) for number in signals}, logging.getLogger().handlers[:]
    folder, before = tmp_path_factory.mktemp("room"), Path.cwd()
    os.chdir(folder)
    yield folder
    os.chdir(before)
    logging.getLogger().handlers[:] = handlers
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture(scope="module")
def told() -> Iterator[list[str]]:
    """What the robot has logged since this list was cleared."""
    messages: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: messages.append(record.getMessage())
    logger = logging.getLogger("lerobot_robot_bimanual")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    yield messages
    logger.removeHandler(handler)


def call(program: str, *more: str, word: str = "") -> None:
    """Run the page's command of one of LeRobot's programs, with more flags, in this process; see `page_command`."""
    name = program.replace("-", "_")
    module = f"lerobot.scripts.{name}" if program.startswith("lerobot-") else program.split()[-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [program, *page_command(program, word), *more])
        runpy.run_module(module, run_name="__main__")


PAUSE = 15 * "."
KEYBOARD = "--teleop.type=bimanual_keyboard"


def type_before(patch: pytest.MonkeyPatch, owner: type, name: str, keys: str) -> None:
    """Have one key typed before each call of a method, and Ctrl-C in the end; a dot is a pause."""
    master, slave = pty.openpty()
    patch.setattr(sys, "stdin", os.fdopen(slave))
    remaining, method = iter(keys), getattr(owner, name)

    def type_and_call(*arguments):
        key = next(remaining, None)
        if key is None:
            raise KeyboardInterrupt
        if key != ".":
            os.write(master, key.encode())
        return method(*arguments)

    patch.setattr(owner, name, type_and_call)


@pytest.fixture(scope="module")
def recorded(room, told) -> Path:
    """A dataset of two episodes, recorded by keys."""
    told.clear()
    first, second = f"1f3{12 * 'c'}{PAUSE}n", f"2{4 * 'cwdd'}{PAUSE}n"
    keys = f"{first}{PAUSE}h{PAUSE}n{PAUSE}{second}{PAUSE}"
    with pytest.MonkeyPatch.context() as patch:
        type_before(patch, BimanualKeyboard, "get_action", keys)
        call("lerobot-record", *SMALL, "--teleop.calibration_dir=calibration")
    return room / "outputs/by_hand"


@pytest.fixture(scope="module")
def trained(recorded, room) -> Path:
    """An ACT that has seen the recording for two steps."""
    call("lerobot-train", *TINY_ACT)
    return room / "outputs/act/checkpoints/last/pretrained_model"


def test_a_demonstration_replays_to_success_and_to_its_last_state(room, told):
    small = ("--image_size=32", "--workers=1")
    assert cli.main([*page_command("lerobot-bimanual"), *small]) == 0
    told.clear()
    call("lerobot-replay", *SMALL)
    dataset = LeRobotDataset("local/demonstrations", root=room / "outputs/demonstrations", episodes=[1])
    last = dataset.hf_dataset[-1][schema.STATE_HASH]
    assert "train seed 1: solved after" in told[-1]
    assert schema.state_hash_column(told[-1].rpartition(" ")[2]) == int(last)


def test_teleoperation_moves_the_hands_until_it_is_interrupted(room, told):
    told.clear()
    with pytest.MonkeyPatch.context() as patch:
        type_before(patch, BimanualKeyboard, "get_action", "3cccc1d")
        call("lerobot-teleoperate", *SMALL, "--teleop.calibration_dir=calibration", word=KEYBOARD)
    assert re.search(r"train seed 0: not solved, unmet: .* after 7 ticks", told[-1])
    assert len(list((room / "outputs/videos").glob("*_unfinished.mp4"))) == 1


def test_a_recording_has_an_episode_per_seed_with_the_columns_of_our_datasets(recorded, told):
    began = [message for message in told if message.endswith('"push the box to the red area"')]
    assert [re.search(r"seed (\d+)", message)[1] for message in began] == ["0", "1"]
    dataset = LeRobotDataset("local/by_hand", root=recorded)
    assert (dataset.num_episodes, dataset.fps) == (2, CONTROL_HZ)
    assert dataset.meta.robot_type == schema.ROBOT_TYPE
    assert {schema.STATE, schema.ACTION, schema.image_key("front")} <= set(dataset.features)
    rows = dataset.hf_dataset.with_format("numpy")[:]
    home = rows[schema.ACTION][0]
    for episode in (0, 1):
        of_it = rows["episode_index"] == episode
        states, actions = rows[schema.STATE][of_it], rows[schema.ACTION][of_it]
        assert abs(states[0] - home).max() < 0.05  # it begins at home
        assert abs(states[-1] - actions[-1]).max() < 0.05  # and the arms follow
        assert abs(actions[-1] - home).max() > 0.1


def test_act_trained_on_a_recording_is_rolled_out(trained, told):
    told.clear()
    call("lerobot-rollout", *SMALL, "--duration=1", "--device=cpu")
    assert "test seed 0: " in told[0]
    assert "not solved, unmet: " in told[1]


def test_an_operator_takes_over_from_a_policy_where_the_robot_is(trained, room, told, monkeypatch):
    told.clear()
    pause_policy, correct = " ", "\t"
    keys = f"{PAUSE}{pause_policy}{PAUSE}{correct}{PAUSE}3cccc{PAUSE}{correct}{PAUSE}"
    type_before(monkeypatch, BimanualSim, "send_action", keys)
    flags = (
        "--strategy.type=dagger --teleop.type=bimanual_keyboard --teleop.calibration_dir=calibration "
        "--dataset.repo_id=local/rollout_corrected --dataset.root=outputs/corrected --dataset.num_episodes=1 "
        "--dataset.fps=20 --dataset.push_to_hub=false "
        "--play_sounds=false --device=cpu --return_to_initial_position=false --duration=60"
    )
    call("lerobot-rollout", *SMALL, *flags.split())
    dataset = LeRobotDataset("local/rollout_corrected", root=room / "outputs/corrected")
    rows = dataset.hf_dataset.with_format("numpy")[:]
    assert dataset.num_episodes == 1
    assert rows["intervention"].all()
    action, state = (by_arm(rows[key][0].astype(float)) for key in (schema.ACTION, schema.STATE))
    # No jump to the keyboard's home. A hand is sent further than it closes, so that it presses on what is thin.
    reached = PANDA_PAIR.finger_target_m(action[:, -1]) / PANDA_PAIR.finger_travel_m
    action[:, -1] = np.maximum(reached, 0.0)
    assert abs(action - state).max() < 0.05
    assert abs(rows[schema.ACTION][-1] - rows[schema.ACTION][0]).max() > 0.01


def test_act_is_served_asynchronously(trained, told, monkeypatch):
    from lerobot.async_inference.configs import PolicyServerConfig
    from lerobot.async_inference.policy_server import PolicyServer
    from lerobot.transport import services_pb2_grpc

    told.clear()
    words = page_command("python -m lerobot.async_inference.policy_server")
    config = draccus.parse(PolicyServerConfig, args=words)
    server = grpc.server(ThreadPoolExecutor(4))
    services_pb2_grpc.add_AsyncInferenceServicer_to_server(PolicyServer(config), server)
    port = server.add_insecure_port(f"{config.host}:0")
    server.start()
    type_before(monkeypatch, BimanualSim, "send_action", PAUSE)
    flags = (*SMALL, f"--server_address={config.host}:{port}", "--actions_per_chunk=5")
    with pytest.raises(KeyboardInterrupt):
        call("python -m lerobot.async_inference.robot_client", *flags)
    server.stop(None).wait()
    assert "test seed 0: not solved" in told[-1]
