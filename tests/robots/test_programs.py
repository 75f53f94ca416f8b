"""LeRobot's programs for robots work as docs/robot.md says: its commands in order, with small settings."""

import logging
import os
import runpy
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import draccus
import grpc
import pytest
from documents import commands
from lerobot.configs.train import TrainPipelineConfig  # noqa: F401  before plugins ask for it
from lerobot.datasets import LeRobotDataset

from lerobot_bimanual import cli
from lerobot_bimanual.dataset import schema
from lerobot_robot_bimanual.bimanual_sim import BimanualSim

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

PAGE = Path(__file__).parents[2] / "docs/robot.md"
CALLS = {"lerobot-rollout": 2}
SMALL = ("--robot.image_size=32", "--robot.calibration_dir=calibration")
TINY_ACT = (
    *("--policy.device=cpu", "--policy.pretrained_backbone_weights=null", "--policy.dim_model=32"),
    *("--policy.n_heads=2", "--policy.dim_feedforward=64", "--policy.n_encoder_layers=1"),
    *("--policy.chunk_size=5", "--policy.n_action_steps=5", "--policy.temporal_ensemble_coeff=null"),
    *("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0"),
)


def page_command(program: str, call: int = 0) -> list[str]:
    """The words after a program's name, in one of its calls on the page."""
    name = program.split()
    calls = [words for words in commands(PAGE) if words[: len(name)] == name]
    assert len(calls) == CALLS.get(program, 1)
    return calls[call][len(name) :]


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


@pytest.fixture
def told() -> Iterator[list[str]]:
    """What the robot logs."""
    messages: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: messages.append(record.getMessage())
    logger = logging.getLogger("lerobot_robot_bimanual")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    yield messages
    logger.removeHandler(handler)


def call(program: str, *more: str, call: int = 0) -> None:
    """Run the page's command of one of LeRobot's programs, with more flags, in this process; see `page_command`."""
    name = program.replace("-", "_")
    module = f"lerobot.scripts.{name}" if program.startswith("lerobot-") else program.split()[-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [program, *page_command(program, call), *more])
        runpy.run_module(module, run_name="__main__")


@pytest.fixture(scope="module")
def demonstrations(room) -> Path:
    """Two of the expert's episodes."""
    assert cli.main([*page_command("lerobot-bimanual"), "--image_size=32", "--workers=1"]) == 0
    return room / "outputs/demonstrations"


@pytest.fixture(scope="module")
def trained(demonstrations, room) -> Path:
    """An ACT that has seen the demonstrations for two steps."""
    call("lerobot-train", *TINY_ACT)
    return room / "outputs/act/checkpoints/last/pretrained_model"


def test_a_demonstration_replays_to_success_and_to_its_last_state(demonstrations, told):
    call("lerobot-replay", *SMALL)
    dataset = LeRobotDataset("local/demonstrations", root=demonstrations, episodes=[1])
    last = dataset.hf_dataset[-1][schema.STATE_HASH]
    (outcome,) = (line for line in told if "train seed 1: solved after" in line)
    assert schema.state_hash_column(outcome.rpartition(" ")[2]) == int(last)


def test_act_trained_on_demonstrations_is_rolled_out(trained, told):
    call("lerobot-rollout", *SMALL, "--duration=1", "--device=cpu")
    assert "test seed 0: " in told[0]
    assert "not solved, unmet: " in told[1]


def test_rollouts_are_recorded_at_the_rate_of_the_ticks_from_seeds_of_their_own(trained, told):
    short = ("--dataset.num_episodes=2", "--dataset.episode_time_s=2", "--dataset.root=outputs/rollout_act")
    call("lerobot-rollout", *SMALL, "--device=cpu", *short, call=1)
    begun = [line for line in told if line.endswith('"')]
    assert ["seed 0:" in begun[0], "seed 1:" in begun[1]] == [True, True]
    recorded = LeRobotDataset("local/rollout_act", root="outputs/rollout_act")
    assert (recorded.fps, recorded.num_episodes) == (20, 2)


def test_act_is_served_asynchronously(trained, told, monkeypatch):
    from lerobot.async_inference.configs import PolicyServerConfig
    from lerobot.async_inference.policy_server import PolicyServer
    from lerobot.transport import services_pb2_grpc

    words = page_command("python -m lerobot.async_inference.policy_server")
    config = draccus.parse(PolicyServerConfig, args=words)
    server = grpc.server(ThreadPoolExecutor(4))
    services_pb2_grpc.add_AsyncInferenceServicer_to_server(PolicyServer(config), server)
    port = server.add_insecure_port(f"{config.host}:0")
    server.start()
    actions, send_action = iter(range(15)), BimanualSim.send_action

    def send_and_interrupt(robot, action):
        if next(actions, None) is None:
            raise KeyboardInterrupt
        return send_action(robot, action)

    monkeypatch.setattr(BimanualSim, "send_action", send_and_interrupt)
    flags = (*SMALL, f"--server_address={config.host}:{port}", "--actions_per_chunk=5")
    with pytest.raises(KeyboardInterrupt):
        call("python -m lerobot.async_inference.robot_client", *flags)
    server.stop(None).wait()
    assert "test seed 0: not solved" in told[-1]
