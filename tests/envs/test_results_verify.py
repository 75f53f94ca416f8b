"""Episodes are recorded while they are played, and any change of a record is found by replay."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from planted_failures import expert_keyposes, played, reproved

from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.proof import actions_from_text, actions_to_text
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.hold_after_done import HoldAfterDone
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv
from lerobot_env_bimanual.verification.episodes import EpisodeVerifier

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module")
def episode() -> Episode:
    return played("lift_ball", expert_keyposes("lift_ball"))


@pytest.fixture(scope="module")
def verifier():
    verifier = EpisodeVerifier("lift_ball", {"split": "test", "max_keyposes": 25})
    yield verifier
    verifier.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", list_tasks())
def test_an_experts_episode_of_every_task_replays_as_recorded(task):
    episode = played(task, expert_keyposes(task))
    assert episode.success
    assert episode.first_met_tick is not None
    verifier = EpisodeVerifier(task, {"split": "test"})
    assert verifier.differences(episode) == verifier.differences(episode) == []
    verifier.close()


def with_actions(episode: Episode, change) -> Episode:
    actions = change(actions_from_text(episode.proof.actions[0]))
    return reproved(episode, actions=(actions_to_text(actions),))


def flipped_bit(actions: np.ndarray) -> np.ndarray:
    actions.view(np.uint32)[1, 2] ^= 1
    return actions


def other_link(links: str) -> str:
    return links[:5] + ("1" if links[5] != "1" else "2") + links[6:]


CHANGES = {
    "a bit of an action": (lambda e: with_actions(e, flipped_bit), "another action or state at step 1"),
    "an action less": (lambda e: with_actions(e, lambda actions: actions[:-1]), "not over after its"),
    "unreadable actions": (lambda e: reproved(e, actions=("7x18:!",)), "cannot be unpacked|not the 7"),
    "the seed": (lambda e: e.model_copy(update={"seed": e.seed + 1}), "another state at the start"),
    "a link": (lambda e: reproved(e, links=other_link(e.proof.links)), "another action or state at step 1"),
    "the last link": (lambda e: reproved(e, end="0" * 64), "chain of state hashes ends otherwise"),
    "the instruction": (lambda e: reproved(e, instruction="win"), "instruction is 'win'"),
} | {
    name: (lambda e, name=name, value=value: e.model_copy(update={name: value}), f"{name} is {value}, but")
    for name, value in {"success": False, "first_met_tick": 1, "ticks": 1, "keyposes": 1}.items()
}


@pytest.mark.parametrize(("change", "message"), CHANGES.values(), ids=CHANGES.keys())
def test_every_change_of_an_episode_is_found(change, message, episode, verifier):
    assert re.search(message, "; ".join(verifier.differences(change(episode))))


@pytest.mark.parametrize("answer", [np.full(16, np.nan), InvalidAction("an action must be a vector")])
def test_an_episode_that_ended_by_a_refused_action_replays_as_recorded(answer, verifier):
    recorder = HoldAfterDone(EpisodeRecorder(BimanualEnv("lift_ball", obs="state")))
    observation, _ = recorder.reset(seed=40_000)
    for _ in range(2):
        recorder.step(observation["agent_pos"])
    episode = recorder.step(answer)[4][PLAYED]
    assert episode.failure.startswith("invalid action: ")
    assert len(episode.proof.action_list()) == 3
    assert verifier.differences(episode) == []
    recorder.close()


def record_file(folder: Path, asynchronous: bool, seeds: list[int]) -> Path:
    """The record that a vector environment leaves of episodes that hold still for a while and then fail."""
    make = partial(BimanualEnv, "lift_ball", obs="state", results_dir=str(folder))
    envs = LazyVectorEnv([make] * 2, asynchronous=asynchronous)
    for pair in (seeds[:2], seeds[2:]):
        envs.reset(seed=pair)
        holding = np.stack([observation["agent_pos"] for observation in envs.call("observe")])
        for _ in range(2):
            envs.step(holding)
        envs.step(np.zeros((2, 18)))
    envs.close()
    return folder / "lift_ball_test_record.json"


def test_records_are_equal_bytes_in_any_number_of_processes_and_any_order(tmp_path, capsys):
    path = record_file(tmp_path / "sync", False, [3, 4, 5, 6])
    for other in (
        record_file(tmp_path / "async", True, [3, 4, 5, 6]),
        record_file(tmp_path / "order", False, [5, 6, 3, 4]),
    ):
        assert other.read_bytes() == path.read_bytes()
    record = EvaluationRecord.read(path)
    assert [episode.seed for episode in record.episodes] == [3, 4, 5, 6]
    assert {episode.failure for episode in record.episodes} == {"left arm: zero quaternion"}

    config = ResultsVerifyConfig(results=path.parent, workers=1)
    assert results_verify(config) == 0
    assert "lift_ball_test_record.json: as claimed, 4 episodes replayed" in capsys.readouterr().out
    first, *rest = record.episodes
    changed = (first.model_copy(update={"ticks": 9}), *rest)
    record.model_copy(update={"episodes": changed, "world": "0" * 12}).write(path)
    assert results_verify(config) == 1
    printed = capsys.readouterr().out
    assert "seed 3: ticks is 9, but 2 in the replay" in printed
    assert "world of lift_ball is 000000000000" in printed
