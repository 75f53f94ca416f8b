"""A policy that is a Python object is scored and recorded like one of LeRobot, and no option of the environment is ignored."""

import gymnasium as gym
import numpy as np
import pytest

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import feature_table
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual import BimanualEnv, evaluate, make_env

SEEDS, NAME = (9, 4, 5), "handover_item_test_record.json"
FEW = {"obs": "state", "max_keyposes": 2, "progress": False}


def hands_down(observation: dict) -> np.ndarray:
    """Keyposes: 5 cm lower than now."""
    poses = observation["ee_pose"].reshape(2, 7) - [0, 0, 0.05, 0, 0, 0, 0]
    return np.hstack([poses, np.ones((2, 2))]).ravel()


class Remembers:
    """Acts as `hands_down`, and fails in the third episode."""

    def __init__(self, fails: bool):
        self.fails, self.episodes, self.sentences = fails, 0, set()

    def reset(self) -> None:
        self.episodes += 1

    def select_action(self, observation: dict) -> np.ndarray:
        self.sentences.add(observation["task"])
        if self.fails and self.episodes == 3:
            raise RuntimeError("it fell off the table")
        return hands_down(observation)


def test_any_callable_leaves_a_record_that_is_verified_and_diagnosed(tmp_path, capsys):
    alone = evaluate(hands_down, "handover_item", SEEDS, **FEW)
    assert [episode.seed for episode in alone.episodes] == sorted(SEEDS)
    places = {"results_dir": tmp_path / "records", "video_dir": tmp_path / "films"}
    beside = evaluate(hands_down, "handover_item", SEEDS, name="down", environments=2, **places, **FEW)
    assert beside.episodes == alone.episodes
    assert EvaluationRecord.read(tmp_path / "records" / NAME) == beside
    assert (beside.batch_size, beside.policy_id, alone.policy_id) == (2, "down", "unnamed")
    assert len([*(tmp_path / "films").glob("*.mp4")]) == len(SEEDS)
    for verb in ("verify", "diagnose"):
        assert main(["results", verb, f"--results={tmp_path / 'records'}", "--workers=1"]) == 0
    told = capsys.readouterr().out
    again = {"name": "down", "environments": 2, **places, **FEW, "progress": True}
    first = evaluate(hands_down, "handover_item", [min(SEEDS)], **again)
    assert first.episodes == beside.episodes[:1]
    capsys.readouterr()
    assert evaluate(hands_down, "handover_item", SEEDS, **again) == beside
    said = capsys.readouterr().err
    assert "test_record.json has are not played again" in said
    assert "handover_item: 0 of 3 episodes solved (3 x out of time)" in said
    assert "as claimed, 3 episodes replayed" in told
    assert "handover_item down" in told


def test_a_policy_that_remembers_is_reset_and_a_named_evaluation_goes_on_where_it_stopped(tmp_path):
    policy = Remembers(fails=True)
    with pytest.raises(RuntimeError, match="fell off"):
        evaluate(policy, "handover_item", SEEDS, name="it", results_dir=tmp_path, **FEW)
    assert len(policy.sentences) > 1
    with pytest.raises(BimanualError, match="its policy may be another one"):
        evaluate(policy, "handover_item", SEEDS, results_dir=tmp_path, **FEW)
    whole = evaluate(Remembers(fails=False), "handover_item", SEEDS, name="it", results_dir=tmp_path, **FEW)
    assert whole.episodes == evaluate(hands_down, "handover_item", SEEDS, **FEW).episodes
    with pytest.raises(BimanualError, match="is of another evaluation") as refused:
        evaluate(hands_down, "handover_item", SEEDS, name="other", results_dir=tmp_path, **FEW)
    assert refused  # the error is kept, as a notebook does
    assert len([*tmp_path.iterdir()]) == 1
    assert evaluate(hands_down, "handover_item", SEEDS, name="it", results_dir=tmp_path, **FEW) == whole
    with pytest.raises(BimanualError, match="remembers one episode"):
        evaluate(policy, "handover_item", SEEDS, environments=2, **FEW)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"seeds": ()}, "seeds is 0"),
        ({"seeds": 5}, r"seeds is 5, but must be integers, such as range\(50\)"),
        ({"seeds": [None]}, r"seeds is \[None\], but must be integers"),
        ({"seeds": [0.5]}, "seed is 0.5, but must be None or an integer"),
        ({"environments": 0}, "is 0"),
        ({"keys": "hf"}, "gymnasium, lerobot"),
    ],
)
def test_what_cannot_be_evaluated_is_refused(options, complaint):
    with pytest.raises(InvalidChoice, match=complaint):
        evaluate(hands_down, "lift_ball", **options)


def test_actions_of_a_wrong_length_are_refused_though_others_fill_up_the_batch():
    with pytest.raises(BimanualError, match="16 or 18 numbers"):
        evaluate(lambda _: np.zeros(7), "lift_ball", [0], environments=2, **FEW)


def test_a_policy_may_write_all_its_actions_into_one_array():
    buffer = np.zeros(18)

    def act(observation: dict) -> np.ndarray:
        buffer[:] = hands_down(observation)
        return buffer

    shared, own = (evaluate(each, "push_box", range(2), environments=2, **FEW) for each in (act, hands_down))
    assert [each.proof for each in shared.episodes] == [each.proof for each in own.episodes]


def test_the_option_keys_gives_gymnasium_environments_lerobots_keys():
    env = gym.make("bimanual/LiftBall-v0", keys="lerobot", image_size=24)
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    features = feature_table.features(BimanualEnv("lift_ball").options.camera_names, 24, 24, "frames")
    shapes = {key: each["shape"] for key, each in features.items() if key.startswith("observation.")}
    assert {key: array.shape for key, array in observation.items()} == {
        key: (shape[2], *shape[:2]) if len(shape) == 3 else shape for key, shape in shapes.items()
    }
    assert env.step(np.full(18, 2.0, np.float32))[2]
    with pytest.raises(InvalidChoice, match=r"results_dir is 'here', but must be given to `evaluate`"):
        make_env("lift_ball", results_dir="here")
