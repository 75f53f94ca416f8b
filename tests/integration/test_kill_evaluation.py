"""Killed at any moment, `lerobot-eval` goes on where it stopped, ends with the same record and leaves nothing behind."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from programs import run
from test_kill_generate import kill

pytestmark = [pytest.mark.weekly, pytest.mark.timeout(36_000)]

KILLS = int(os.environ.get("KILLS", "1"))
"""Of each kind; the drill takes a hundred."""
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


@pytest.mark.parametrize(
    ("number", "asynchronous"),
    [
        (signal.SIGTERM, True),
        (signal.SIGKILL, False),
        *([(signal.SIGTERM, False), (signal.SIGKILL, True)] if KILLS > 1 else []),
    ],
)
def test_a_killed_evaluation_loses_at_most_what_was_running(number, asynchronous, undisturbed, tmp_path):
    expected, duration_s = undisturbed
    rng, kills, runs, kept, is_whole = np.random.default_rng(), 0, 0, set(), False
    while kills < KILLS or not is_whole:
        folder = tmp_path / str(runs)
        folder.mkdir(exist_ok=True)
        child = start(folder, asynchronous)
        try:
            # Programs load for the first half.
            child.wait(None if kills >= KILLS else duration_s * rng.uniform(0.4, 1.0))
        except subprocess.TimeoutExpired:
            kill(child, "parent", number)
            kills += 1
            said = {int(seed) for seed in re.findall(r"seed (\d+): ", (folder / "log").read_text())}
            text = "".join(path.read_text() for path in (folder / "records").glob("*"))
            found = {int(seed) for seed in re.findall(r'"seed": ?(\d+), ?"variation', text)}
            assert said | kept <= found
            assert len(found) <= EPISODES
            kept, is_whole = found, False
            continue
        assert child.returncode == 0, (folder / "log").read_text()[-3000:]
        assert [path.name for path in (folder / "records").iterdir()] == [NAME]
        assert (folder / "records" / NAME).read_bytes() == expected
        films = sorted(path.name for path in (folder / "films").iterdir())
        assert [re.findall(r"seed(\d+)", name) for name in films] == sorted([str(n)] for n in range(7, 14))
        info = json.loads((folder / "eval" / "eval_info.json").read_text())
        solved = [episode["success"] for episode in json.loads(expected)["episodes"]]
        assert info["per_task"][0]["metrics"]["successes"] == solved
        runs, kept, is_whole = runs + 1, set(), True


def test_lerobots_own_recording_is_refused_with_what_to_use_instead(tmp_path):
    words = ["lerobot-eval", f"--policy.path={TRAINED}", "--policy.device=cpu", "--env.type=bimanual"]
    said = run(*words, "--eval.recording=true", folder=tmp_path, fails=True)
    assert "dataset from-results" in said.splitlines()[-1]
