"""The evidence of a solved episode: replays and keyframes that are wrong are found out."""

import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.evidence import EvidenceRecorder
from lerobot_env_bimanual.experts.runner import run_expert


@pytest.fixture(scope="module")
def env():
    env = BimanualEnv("lift_ball", split="val", obs="state")
    yield env
    env.close()


def noted(env):
    moves = []
    recorder = EvidenceRecorder(env)
    with env.observed_by(recorder.note, recorder.note_step):
        outcome = run_expert(env, 2, on_move=moves.append)
    assert not env.tick_observers
    assert not env.step_observers
    return recorder, [move.action for move in moves], [report.ticks for report in outcome.keyposes]


@pytest.mark.sim
@pytest.mark.parametrize("mode", ["joint", "keypose"])
def test_an_episode_replays_from_its_actions(env, mode):
    recorder, keyposes, ticks = noted(env)
    evidence = recorder.evidence(keyposes, ticks, mode)
    assert evidence.replayed is True
    assert evidence.keyframes_found


@pytest.mark.sim
def test_a_replay_of_other_actions_is_found_out(env):
    recorder, keyposes, ticks = noted(env)
    keyposes[0] = keyposes[0] + np.float32(1e-6)
    assert recorder.evidence(keyposes, ticks, "keypose").replayed is False


@pytest.mark.sim
def test_wrong_keyframes_are_found_out(env):
    recorder, keyposes, ticks = noted(env)
    ticks[0] += 5
    ticks[1] -= 5
    evidence = recorder.evidence(keyposes, ticks, "none")
    assert not evidence.keyframes_found
    assert evidence.replayed is None
