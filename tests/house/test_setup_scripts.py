"""The set-up scripts, run in a scratch folder with a fake uv and a fake python3."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COPIED = [
    *("scripts/find_uv.sh", "scripts/setup.sh", ".python-version", "requirements.lock"),
    *("pyproject.toml", "envs/pyproject.toml", "policies/pyproject.toml", "robots/pyproject.toml"),
]
FAKE_UV = """#!/usr/bin/env bash
echo "$*" >>"$HOME/uv.log"
[[ -z ${FAIL:-} || $1 != pip ]] || exit 1
if [[ $1 == venv ]]; then
    mkdir -p .venv/bin
    echo "VIRTUAL_ENV=$PWD/.venv" >.venv/bin/activate
    printf '#!/bin/sh\\nexit 0\\n' >.venv/bin/python
    chmod +x .venv/bin/python
fi
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of the files that the scripts read, beside a HOME with a uv and a PATH whose first uv does not work."""
    for name in COPIED:
        (tmp_path / "repo" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / "repo" / name)
    write_script(tmp_path / "bin/uv", "#!/bin/sh\nexit 127\n")
    write_script(tmp_path / "home/.local/bin/uv", FAKE_UV)
    return tmp_path / "repo"


def write_script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(checkout: Path, script: str, **variables: str) -> subprocess.CompletedProcess[str]:
    paths = {"HOME": str(checkout.parent / "home"), "PATH": f"{checkout.parent / 'bin'}:/usr/bin:/bin"}
    command = [checkout / "scripts" / script]
    return subprocess.run(
        command, env=os.environ | paths | variables, capture_output=True, text=True, check=False
    )


def uv_calls(checkout: Path) -> list[str]:
    lines = (checkout.parent / "home/uv.log").read_text().splitlines()
    return [line.split()[0] for line in lines if line != "--version"]


def test_a_python_without_venv_is_explained(checkout: Path) -> None:
    (checkout.parent / "home/.local/bin/uv").unlink()
    write_script(checkout.parent / "bin/python3", "#!/bin/sh\nmkdir -p .uv\nexit 1\n")
    found = run(checkout, "find_uv.sh")
    assert found.returncode == 1
    assert "apt-get install -y python3-venv" in found.stderr


def test_set_up_does_what_is_missing_and_nothing_else(checkout: Path) -> None:
    assert run(checkout, "setup.sh", FAIL="1").returncode != 0
    assert run(checkout, "setup.sh").returncode == 0
    made = ["venv", "pip", "pip", "pip"]
    assert uv_calls(checkout) == made
    run(checkout, "setup.sh")
    assert uv_calls(checkout) == made
    (checkout / "requirements.lock").write_text("numpy==2.2.6\n")
    run(checkout, "setup.sh")
    assert uv_calls(checkout) == [*made, "pip", "pip"]
    moved = checkout.rename(checkout.with_name("moved"))
    run(moved, "setup.sh")
    assert uv_calls(moved) == [*made, "pip", "pip", "venv", "pip", "pip"]
