"""One task certified anew: the certificate keeps what is of the others."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CERTIFICATES = sorted((ROOT / "results/certificates").glob("*.json"))


def renew(path: Path, new: Path) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, ROOT / "scripts/renew_certificate.py", path, new]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("committed", CERTIFICATES, ids=lambda path: path.stem)
def test_a_certificate_renewed_by_its_own_tasks_keeps_its_bytes(committed: Path, tmp_path: Path):
    path = Path(shutil.copy(committed, tmp_path))
    content = json.loads(committed.read_text())
    task = content["rates"][-1]["task"]
    alone = {
        **content,
        "worlds": {task: content["worlds"][task]},
        "complaints": [line for line in content["complaints"] if line.startswith(task)],
        **{name: [row for row in content[name] if row["task"] == task] for name in ("rates", "episodes")},
    }
    new = tmp_path / "new.json"
    new.write_text(json.dumps(alone))

    done = renew(path, new)

    assert done.returncode == 0, done.stdout + done.stderr
    assert path.read_bytes() == committed.read_bytes()


def test_a_task_that_was_not_certified_yet_joins_the_others(tmp_path: Path):
    (committed,) = (path for path in CERTIFICATES if path.stem == "noop")
    content = json.loads(committed.read_text())
    path, new = tmp_path / "noop.json", tmp_path / "new.json"
    for file, is_there in ((path, lambda task: task != "lift_ball"), (new, lambda task: task == "lift_ball")):
        part = {
            name: [row for row in content[name] if is_there(row["task"])] for name in ("rates", "episodes")
        }
        worlds = {task: world for task, world in content["worlds"].items() if is_there(task)}
        file.write_text(json.dumps({**content, "worlds": worlds, **part}))

    done = renew(path, new)

    assert done.returncode == 0, done.stdout + done.stderr
    renewed = json.loads(path.read_text())
    assert renewed["rates"] == content["rates"]
    assert renewed["worlds"] == content["worlds"]


def test_a_certificate_is_not_renewed_by_what_contradicts_it(tmp_path: Path):
    (committed,) = (path for path in CERTIFICATES if path.stem == "noop")
    path, new = Path(shutil.copy(committed, tmp_path)), tmp_path / "new.json"
    content = json.loads(committed.read_text())
    for change, message in (
        ({"seeds": "0:50"}, "certify all tasks anew"),
        ({"rates": content["rates"][1:]}, "rates"),
    ):
        new.write_text(json.dumps({**content, **change}))
        done = renew(path, new)
        assert done.returncode == 1
        assert message in done.stdout
        assert path.read_bytes() == committed.read_bytes()
