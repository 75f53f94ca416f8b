"""Episodes of an evaluation are on disk as they end, and any change of a record is found by replay."""

import ast
import logging
import re
import zlib
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from planted_failures import expert_keyposes, played, reproved

from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.proof import actions_from_text, actions_to_text
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.evaluation import Evaluation, KeptEpisodes
from lerobot_env_bimanual.vector.hold_after_done import HoldAfterDone
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv
from lerobot_env_bimanual.verification.episodes import EpisodeVerifier

SEEDS = range(3, 8)


class Interrupted(Exception):
    """The end of a process, as far as its files are concerned."""


class Program:
    """Evaluates like `lerobot-eval`, two environments at a time; its policy draws random numbers."""

    def __init__(self, folder: Path | None, asynchronous=False, policy="a", seeds=SEEDS, **options):
        self.steps, self.successes = 0, []
        self._rng = np.random.default_rng(0)
        who = Evaluation({"type": policy} if policy else {}, seeds, self._state, self._set_state)
        make = partial(BimanualEnv, "lift_ball", obs="state", **options)
        self.envs = LazyVectorEnv(
            [make] * 2, asynchronous=asynchronous, evaluation=who, results_dir=folder and str(folder)
        )

    def run(self, steps: int = 1000) -> "Program":
        """Evaluate; the process ends after so many steps."""
        for start in range(SEEDS.start, SEEDS.stop, 2):
            self.envs.reset(seed=[start, start + 1])
            over = success = np.zeros(2, bool)
            while not over.all():
                if self.steps == steps:
                    raise Interrupted
                self.steps += 1
                actions = np.stack([each["agent_pos"] for each in self.envs.call("observe")])
                actions += self._rng.normal(0, 1e-3, actions.shape)
                if self._rng.random() < 0.3:
                    actions[self._rng.integers(2)] = np.nan
                *_, terminated, truncated, info = self.envs.step(actions.astype(np.float32))
                over = over | terminated | truncated
                success = success | info["is_success"].astype(bool)
            self.successes += success.tolist()
        self.envs.close()
        return self

    def end(self) -> None:
        """Let go of files and processes without a word to the environments."""
        self.envs._drop()
        self.envs._episodes._kept._journal.close()

    def _state(self) -> str:
        return str(self._rng.bit_generator.state)

    def _set_state(self, text: str) -> None:
        self._rng.bit_generator.state = ast.literal_eval(text)


NAME = "lift_ball_test_record.json"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[bytes, Program]:
    folder = tmp_path_factory.mktemp("undisturbed")
    program = Program(folder).run()
    return (folder / NAME).read_bytes(), program


@pytest.mark.parametrize("asynchronous", [False, True])
def test_an_evaluation_that_ends_anywhere_leaves_the_same_record(asynchronous, undisturbed, tmp_path):
    expected, whole = undisturbed
    for share in (0.5, 0.4):
        program = Program(tmp_path, asynchronous)
        with pytest.raises(Interrupted):
            program.run(int(share * whole.steps))
        program.end()
        assert [path.suffix for path in tmp_path.iterdir()] == [".jsonl"]
        with (tmp_path / NAME).with_suffix(".partial.jsonl").open("a") as file:
            file.write('{"episode": {"seed": 7, "succ')  # as a full disk leaves a line
    last = Program(tmp_path, asynchronous).run()
    assert (tmp_path / NAME).read_bytes() == expected
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
    assert last.successes == whole.successes
    assert last.steps < whole.steps, "what was finished was played again"


@pytest.mark.parametrize("kept", [True, False])
def test_episodes_that_fill_up_the_last_batch_are_not_played(kept, undisturbed, tmp_path, caplog):
    record = EvaluationRecord.from_json(undisturbed[0])
    assert [episode.seed for episode in record.episodes] == [*SEEDS]
    with caplog.at_level(logging.INFO):
        Program(tmp_path if kept else None, video_dir=str(tmp_path / "films")).run().envs.close()
    assert "0 of 5 episodes solved" in caplog.text
    films = {int(path.stem.split("seed")[1].split("_")[0]) for path in (tmp_path / "films").iterdir()}
    assert films == {episode.seed for episode in record.episodes if episode.ticks}
    assert "films, but" not in caplog.text
    if kept:
        with caplog.at_level(logging.INFO):
            Program(tmp_path, video_dir=str(tmp_path / "none")).run().envs.close()
        assert "none, but none of 5 played earlier" in caplog.text


OTHERS = {
    "a policy": ({"policy": "b"}, "type of its policy is 'a', not 'b'"),
    "no known policy": ({"policy": ""}, "its policy may be another one"),
    "an option": ({"max_keyposes": 3}, "max_keyposes of its options is 25, not 3"),
}


@pytest.mark.parametrize("is_whole", [False, True])
@pytest.mark.parametrize(("other", "complaint"), OTHERS.values(), ids=OTHERS)
def test_another_evaluation_in_the_same_folder_is_refused_at_once(other, complaint, is_whole, tmp_path):
    program = Program(tmp_path, seeds=range(3, 4 if is_whole else 8))
    if is_whole:
        program.run()
    else:
        with pytest.raises(Interrupted):
            program.run(3)
        with pytest.raises(BimanualError, match="is being written by another process"):
            Program(tmp_path)
        program.end()
    (path,) = tmp_path.iterdir()
    before = path.read_bytes()
    with pytest.raises(BimanualError, match=complaint):
        Program(tmp_path, **other)
    assert path.read_bytes() == before


def test_a_file_of_episodes_with_another_schema_version_is_refused_by_name(undisturbed, tmp_path):
    program = Program(tmp_path)
    with pytest.raises(Interrupted):
        program.run(undisturbed[1].steps // 2)
    program.end()
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text().replace('"schema_version":2', '"schema_version":1', 1))
    with pytest.raises(BimanualError, match=rf"{path.name}: schema_version: .*; choose another results_dir"):
        Program(tmp_path)


def test_a_policy_of_another_world_is_evaluated_with_a_warning(tmp_path, caplog):
    here = world_version("lift_ball")
    for world, perturb, warned in (("0" * 12, "", True), (here, "", False), ("0" * 12, "mass:1", False)):
        caplog.clear()
        who = Evaluation({"type": "a"}, trained_worlds={"lift_ball": world, "push_box": "1" * 12})
        options = EnvOptions(perturb=perturb)
        KeptEpisodes(tmp_path / f"{world}{perturb}", "lift_ball", options, 1, who).open()
        said = f"the policy learned lift_ball in world {world}, and is evaluated in {here}"
        assert (said in caplog.text) is warned


@pytest.fixture(scope="module")
def episode() -> Episode:
    return played("lift_ball", expert_keyposes("lift_ball"))


@pytest.fixture(scope="module")
def verifier():
    return EpisodeVerifier("lift_ball", {"split": "test", "max_keyposes": 25})


@pytest.mark.slow
@pytest.mark.parametrize("task", list_tasks())
def test_an_experts_episode_of_every_task_replays_as_recorded(task):
    episode = played(task, expert_keyposes(task))
    assert episode.success
    assert episode.first_met_tick is not None
    verifier = EpisodeVerifier(task, {"split": "test", "variation": 0})
    assert verifier(episode) == verifier(episode) == []


def test_an_episode_of_another_variation_than_the_options_say_does_not_replay():
    episode = played("handover_item", np.zeros((1, 18)))
    assert EpisodeVerifier("handover_item", {"variation": 0})(episode) == []
    assert EpisodeVerifier("handover_item", {"variation": 1})(episode) == ["another state at the start"]


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
    "an action more": (
        lambda e: with_actions(e, lambda actions: actions[[*range(len(actions)), -1]]),
        "further actions",
    ),
    "unreadable actions": (lambda e: reproved(e, actions=("7x18:!",)), "cannot be unpacked|not the 7"),
    "the seed": (lambda e: e.model_copy(update={"seed": e.seed + 1}), "another state at the start"),
    "a link": (lambda e: reproved(e, links=other_link(e.proof.links)), "another action or state at step 1"),
    "unreadable links": (lambda e: reproved(e, links='"'), "cannot be compared: "),
    "the last link": (lambda e: reproved(e, end="0" * 64), "end of the chain of state hashes differs"),
    "the instruction": (lambda e: reproved(e, instruction="win"), "instruction is 'win'"),
} | {
    name: (lambda e, name=name, value=value: e.model_copy(update={name: value}), f"{name} is {value}, but")
    for name, value in {"success": False, "first_met_tick": 1, "ticks": 1, "keyposes": 1}.items()
}


@pytest.mark.parametrize(("change", "message"), CHANGES.values(), ids=CHANGES.keys())
def test_every_change_of_an_episode_is_found(change, message, episode, verifier):
    assert re.search(message, "; ".join(verifier(change(episode))))


def test_actions_that_another_zlib_has_packed_replay_as_recorded(episode, verifier, monkeypatch):
    pack = zlib.compress
    monkeypatch.setattr(zlib, "compress", lambda data, level: pack(data, level=0))
    repacked = with_actions(episode, lambda actions: actions)
    assert repacked.proof.actions != episode.proof.actions
    monkeypatch.undo()
    assert verifier(repacked) == []


@pytest.mark.parametrize("answer", [np.full(16, np.nan), InvalidAction("an action must be a vector")])
def test_an_episode_that_ended_by_a_refused_action_replays_as_recorded(answer, verifier):
    recorder = HoldAfterDone(EpisodeRecorder(BimanualEnv("lift_ball", obs="state")))
    observation, _ = recorder.reset(seed=40_000)
    for _ in range(2):
        recorder.step(observation["agent_pos"])
    episode = recorder.step(answer)[4][PLAYED]
    assert episode.failure.startswith("invalid action: ")
    assert len(episode.proof.action_list()) == 3
    assert verifier(episode) == []


def test_results_verify_confirms_a_record_and_reports_changes_in_it(undisturbed, tmp_path, capsys):
    path = tmp_path / NAME
    path.write_bytes(undisturbed[0])
    record, config = EvaluationRecord.read(path), ResultsVerifyConfig(results=tmp_path, workers=1)
    assert {episode.failure.split(":")[0] for episode in record.episodes} == {"invalid action"}
    assert results_verify(config) == 0
    assert f"{NAME}: as claimed, 5 episodes replayed" in capsys.readouterr().out
    first, *rest = record.episodes
    changed = (first.model_copy(update={"ticks": 999}), *rest)
    record.model_copy(update={"episodes": changed, "world": "0" * 12}).write(path)
    assert results_verify(config) == 1
    printed = capsys.readouterr().out
    assert f"seed 3: ticks is 999, but {first.ticks} in the replay" in printed
    assert f"world of lift_ball is 000000000000, but {world_version('lift_ball')} here" in printed
    elsewhere = record.model_copy(update={"episodes": changed, "versions": {"libc": "glibc-1.0"}})
    elsewhere.write(path)
    assert results_verify(config) == 1
    assert f"{NAME}: inconclusive, made with the C library glibc-1.0 (here: " in capsys.readouterr().out
