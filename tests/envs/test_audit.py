"""Episodes are recorded while they are played, and a record that was changed in any way is found out."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from planted_failures import evaluation, reproved

from lerobot_bimanual import cli
from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.results.action_text import actions_from_text, actions_to_text
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.audit.episodes import EpisodeAuditor, placement_hash
from lerobot_env_bimanual.audit.result_files import result_files
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.hold_after_done import HoldAfterDone
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

pytestmark = pytest.mark.sim

SEED = 40_000


def played_by_expert(task: str, seed: int = SEED) -> Episode:
    """The record of an expert's episode, by keyposes."""
    env = BimanualEnv(task, obs="state")
    recorder = EpisodeRecorder(env)
    info = recorder.reset(seed=seed)[1]
    for move in expert()(env):
        info = recorder.step(move.action)[4]
        if PLAYED in info:
            break
    env.close()
    return info[PLAYED]


@pytest.fixture(scope="module")
def played() -> Episode:
    return played_by_expert("lift_ball")


@pytest.fixture(scope="module")
def auditor():
    auditor = EpisodeAuditor("lift_ball", {"split": "test", "max_keyposes": 25})
    yield auditor
    auditor.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", list_tasks())
def test_an_experts_episode_of_every_task_is_found_as_recorded(task):
    played = played_by_expert(task)
    assert played.success
    assert played.first_met_tick is not None
    auditor = EpisodeAuditor(task, {"split": "test"})
    assert auditor.audit(played).problems == ()
    assert auditor.audit(played).problems == ()
    auditor.close()


def actions_of(played: Episode) -> str:
    assert played.proof is not None
    return played.proof.actions[0]


def one_bit_of_action(played: Episode) -> Episode:
    actions = actions_from_text(actions_of(played))
    actions.view(np.uint32)[1, 2] ^= 1
    return reproved(played, actions=(actions_to_text(actions),))


def fewer_actions(played: Episode) -> Episode:
    return reproved(played, actions=(actions_to_text(actions_from_text(actions_of(played))[:-1]),))


def another_link(played: Episode) -> Episode:
    assert played.proof is not None
    links = played.proof.links
    first = "1" if links[5] != "1" else "2"
    return reproved(played, links=links[:5] + first + links[6:])


DAMAGES = {
    "an action": (one_bit_of_action, "another action or state at step 1, ticks "),
    "an action less": (fewer_actions, "not over after its"),
    "unreadable actions": (
        lambda played: reproved(played, actions=("7x18:!",)),
        "cannot be unpacked|not the 7",
    ),
    "a seed": (lambda played: played.model_copy(update={"seed": SEED + 1}), "another state at the start"),
    "the state at the start": (
        lambda played: reproved(played, start="0" * 64),
        "another state at the start",
    ),
    "a link": (another_link, "another action or state at step 1"),
    "the last link": (lambda played: reproved(played, end="0" * 64), "chain of state hashes ends otherwise"),
    "the outcome": (
        lambda played: played.model_copy(update={"success": False, "failure": "out of time"}),
        "success is False, but True when it is played again",
    ),
    "the first tick of success": (
        lambda played: played.model_copy(update={"first_met_tick": played.first_met_tick - 1}),
        "first_met_tick is",
    ),
    "the ticks": (lambda played: played.model_copy(update={"ticks": played.ticks + 1}), "ticks is"),
    "the keyposes": (lambda played: played.model_copy(update={"keyposes": 1}), "keyposes is 1"),
    "the instruction": (lambda played: reproved(played, instruction="win"), "instruction is 'win'"),
}


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES.keys())
def test_one_changed_thing_is_found(damage, message, played, auditor):
    problems = auditor.audit(damage(played)).problems
    assert problems
    assert re.search(message, "; ".join(problems))


def test_what_was_not_changed_is_as_claimed(played, auditor):
    assert auditor.audit(played).problems == ()


@pytest.mark.parametrize("answer", [np.full(16, np.nan), InvalidAction("an action must be a vector")])
def test_episodes_that_ended_by_a_refused_answer_are_found_as_recorded(answer, auditor):
    player = HoldAfterDone(EpisodeRecorder(BimanualEnv("lift_ball", obs="state")))
    observation, _ = player.reset(seed=SEED)
    for _ in range(2):
        player.step(observation["agent_pos"])
    info = player.step(answer)[4]
    record = info[PLAYED]
    assert record.failure.startswith("invalid action: ")
    assert len(record.proof.action_list()) == 3
    assert auditor.audit(record).problems == ()
    player.close()


def rolled_out(folder: Path, asynchronous: bool, seeds: list[int]) -> bytes:
    """The record that a vector environment leaves of episodes that hold still for a while and then give up."""
    make = partial(BimanualEnv, "lift_ball", obs="state", results_dir=str(folder))
    envs = LazyVectorEnv([make] * 2, asynchronous=asynchronous)
    for pair in (seeds[:2], seeds[2:]):
        envs.reset(seed=pair)
        holding = np.stack([observation["agent_pos"] for observation in envs.call("observe")])
        for _ in range(2):
            envs.step(holding)
        envs.step(np.zeros((2, 18)))
    envs.close()
    return (folder / "lift_ball_test_record.json").read_bytes()


def test_records_are_equal_bytes_in_one_process_and_in_several_and_after_other_episodes(tmp_path, capsys):
    records = [
        rolled_out(tmp_path / "sync", False, [3, 4, 5, 6]),
        rolled_out(tmp_path / "async", True, [3, 4, 5, 6]),
        rolled_out(tmp_path / "order", False, [5, 6, 3, 4]),
    ]
    assert records[0] == records[1] == records[2]
    record = EvaluationRecord.read(tmp_path / "sync" / "lift_ball_test_record.json")
    assert [episode.seed for episode in record.episodes] == [3, 4, 5, 6]
    assert {episode.failure for episode in record.episodes} == {"left arm: zero quaternion"}

    config = ResultsVerifyConfig(results=tmp_path / "sync", workers=1)
    assert results_verify(config) == 0
    assert "lift_ball_test_record.json: as claimed" in capsys.readouterr().out
    changed = (record.episodes[0].model_copy(update={"ticks": 9}), *record.episodes[1:])
    record.model_copy(update={"episodes": changed}).write(tmp_path / "sync" / "lift_ball_test_record.json")
    assert results_verify(config) == 1
    assert "seed 3: ticks is 9, but 2 when it is played again" in capsys.readouterr().out


def test_a_record_of_another_world_is_named(played, tmp_path, capsys):
    record = evaluation("lift_ball", {"split": "test"}, played, world="0" * 12)
    record.write(tmp_path / "record.json")
    assert results_verify(ResultsVerifyConfig(results=tmp_path / "record.json", workers=1)) == 1
    assert "world of lift_ball is 000000000000" in capsys.readouterr().out


def test_a_folder_without_records_holds_no_results(tmp_path):
    with pytest.raises(BimanualError, match="holds no results"):
        result_files(tmp_path)
    (tmp_path / "lift_ball_test_record.json").write_text("{}")
    assert [path.name for path in result_files(tmp_path)] == ["lift_ball_test_record.json"]


@pytest.mark.parametrize(
    "words",
    [
        ["results", "diagnose", "--results=."],
        ["results", "verify", "--results=."],
        ["dataset", "verify", "--root=."],
    ],
)
def test_draws_by_a_seed_below_0_are_refused_on_one_line(words, capsys):
    assert cli.main([*words, "--seed=-1"]) == 1
    assert capsys.readouterr().err.strip().endswith("seed is -1, but must be at least 0")


def test_fifty_keypose_episodes_take_less_than_500_kb(played):
    assert 50 * len(played.to_json()) < 500_000


@pytest.mark.parametrize("task", list_tasks())
def test_no_two_placements_of_a_task_are_taken_for_one(task: str):
    env = BimanualEnv(task, obs="state")
    hashes = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        hashes.append(placement_hash(env))
    env.close()

    assert hashes[0] != hashes[1]
    assert hashes[0] == hashes[2]
