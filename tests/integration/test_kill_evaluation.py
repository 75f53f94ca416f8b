"""Killed at any moment, `lerobot-eval` goes on where it stopped, ends with the same record and leaves nothing behind."""

import json
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from programs import run
from test_kill_generate import kill

pytestmark = [pytest.mark.weekly, pytest.mark.timeout(36_000)]

TRAINED = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"
NAME = "lift_ball_test_record.json"
EPISODES = 7


def start(folder: Path, asynchronous: bool) -> subprocess.Popen:
    words = [
        *("-m", "lerobot.scripts.lerobot_eval", f"--policy.path={TRAINED}", "--policy.device=cpu"),
        *("--env.type=bimanual", "--env.task=lift_ball", "--env.image_size=128", "--seed=7"),
        *(f"--env.results_dir={folder / 'records'}", f"--env.video_dir={folder / 'films'}"),
        *(f"--eval.n_episodes={EPISODES}", "--eval.batch_size=2", f"--output_dir={folder / 'eval'}"),
        f"--eval.use_async_envs={str(asynchronous).lower()}",
    ]
    with (folder / "log").open("wb") as log:
        return subprocess.Popen([sys.executable, *words], stdout=log, stderr=log, start_new_session=True)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[bytes, float]:
    """The record, and the seconds that it took."""
    folder, begin = tmp_path_factory.mktemp("undisturbed"), time.monotonic()
    assert start(folder, asynchronous=True).wait() == 0
    return (folder / "records" / NAME).read_bytes(), time.monotonic() - begin


@pytest.mark.parametrize(("number", "asynchronous"), [(signal.SIGTERM, True), (signal.SIGKILL, False)])
def test_a_killed_evaluation_loses_at_most_what_was_running(number, asynchronous, undisturbed, tmp_path):
    expected, duration_s = undisturbed
    child = start(tmp_path, asynchronous)
    with suppress(subprocess.TimeoutExpired):
        child.wait(duration_s * np.random.default_rng().uniform(0.4, 0.9))  # programs load for the first half
    kill(child, "parent", number)
    said = {int(seed) for seed in re.findall(r"seed (\d+): ", (tmp_path / "log").read_text())}
    text = "".join(path.read_text() for path in (tmp_path / "records").glob("*"))
    found = {int(seed) for seed in re.findall(r'"seed": ?(\d+), ?"variation', text)}
    assert said <= found
    assert len(found) <= EPISODES
    child = start(tmp_path, asynchronous)
    assert child.wait() == 0, (tmp_path / "log").read_text()[-3000:]
    assert [path.name for path in (tmp_path / "records").iterdir()] == [NAME]
    assert (tmp_path / "records" / NAME).read_bytes() == expected
    films = sorted(path.name for path in (tmp_path / "films").iterdir())
    assert [re.findall(r"seed(\d+)", name) for name in films] == sorted([str(n)] for n in range(7, 14))
    info = json.loads((tmp_path / "eval" / "eval_info.json").read_text())
    solved = [episode["success"] for episode in json.loads(expected)["episodes"]]
    assert info["per_task"][0]["metrics"]["successes"] == solved


def test_lerobots_own_recording_is_refused_with_what_to_use_instead(tmp_path):
    words = ["lerobot-eval", f"--policy.path={TRAINED}", "--policy.device=cpu", "--env.type=bimanual"]
    said = run(*words, "--eval.recording=true", folder=tmp_path, fails=True)
    assert "dataset from-results" in said.splitlines()[-1]
