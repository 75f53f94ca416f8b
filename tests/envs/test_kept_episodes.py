"""Episodes of an evaluation are on disk as they end; the same evaluation goes on, and another one is refused."""

import ast
import logging
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.vector.evaluation import Evaluation
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

pytestmark = pytest.mark.sim

SEEDS = range(3, 8)


class Interrupted(Exception):
    """The end of a process, as far as its files are concerned."""


class Program:
    """Evaluates like `lerobot-eval`, two environments at a time; its policy draws random numbers.

    Args:
        folder: of the records.
        asynchronous: whether environments have processes of their own.
        policy: what is evaluated.
        options: of the environment.
    """

    def __init__(self, folder: Path, asynchronous=False, policy="a", seeds=SEEDS, films=False, **options):
        self.steps, self.successes, self._films = 0, [], films
        self._rng = np.random.default_rng(0)
        who = Evaluation(
            {"type": policy} if policy else {}, seeds, self._random_state, self._set_random_state
        )
        make = partial(BimanualEnv, "lift_ball", obs="state", results_dir=str(folder), **options)
        self.envs = LazyVectorEnv([make] * 2, asynchronous=asynchronous, evaluation=who)

    def run(self, steps: int = 1000) -> "Program":
        """Evaluate; the process ends after so many steps."""
        for start in range(SEEDS.start, SEEDS.stop, 2):
            self.envs.reset(seed=[start, start + 1])
            over = success = np.zeros(2, bool)
            while not over.all():
                if self._films:
                    self.envs.call("render")
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

    def _random_state(self) -> str:
        return str(self._rng.bit_generator.state)

    def _set_random_state(self, text: str) -> None:
        self._rng.bit_generator.state = ast.literal_eval(text)


NAME = "lift_ball_test_record.json"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[bytes, Program]:
    folder = tmp_path_factory.mktemp("undisturbed")
    program = Program(folder).run()
    return (folder / NAME).read_bytes(), program


@pytest.mark.parametrize(("asynchronous", "films"), [(False, False), (True, False), (False, True)])
def test_an_evaluation_that_ends_anywhere_goes_on_there_and_leaves_the_same_record(
    asynchronous, films, undisturbed, tmp_path
):
    expected, whole = undisturbed
    for share in (0.5, 0.7 if films else 0.4):
        program = Program(tmp_path, asynchronous, films=films)
        with pytest.raises(Interrupted):
            program.run(int(share * whole.steps))
        program.end()
        assert [path.suffix for path in tmp_path.iterdir()] == [".jsonl"]
        with (tmp_path / NAME).with_suffix(".partial.jsonl").open("a") as file:
            file.write('{"episode": {"seed": 7, "succ')  # as a full disk leaves a line
    last = Program(tmp_path, asynchronous, films=films).run()
    assert (tmp_path / NAME).read_bytes() == expected
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
    assert last.successes == whole.successes
    assert films or last.steps < whole.steps, "what was finished was played again"


def test_episodes_that_fill_up_the_last_batch_are_neither_played_nor_recorded(undisturbed, tmp_path, caplog):
    record = EvaluationRecord.from_json(undisturbed[0])
    assert [episode.seed for episode in record.episodes] == [*SEEDS]
    with caplog.at_level(logging.INFO):
        Program(tmp_path, video_dir=str(tmp_path / "films")).run()
    assert "0 of 5 episodes solved" in caplog.text
    films = {int(path.stem.split("seed")[1].split("_")[0]) for path in (tmp_path / "films").iterdir()}
    assert films <= {*SEEDS}


OTHERS = {
    "a policy": ({"policy": "b"}, "type of its policy is 'a', not 'b'"),
    "no known policy": ({"policy": ""}, "its policy may be another one"),
    "an option": ({"max_keyposes": 3}, "max_keyposes of its options is 25, not 3"),
}


@pytest.mark.parametrize("is_whole", [False, True])
@pytest.mark.parametrize(("other", "complaint"), OTHERS.values(), ids=OTHERS)
def test_another_evaluation_in_the_same_folder_is_refused_before_it_begins(
    other, complaint, is_whole, tmp_path
):
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
