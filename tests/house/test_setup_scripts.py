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
if [[ $1 == venv ]]; then
    mkdir -p .venv/bin
    echo "VIRTUAL_ENV=$PWD/.venv" >.venv/bin/activate
    printf '#!/bin/sh\\nexit 0\\n' >.venv/bin/python
    chmod +x .venv/bin/python
fi
"""
FAKE_PYTHON3 = """#!/usr/bin/env bash
mkdir -p "$3/bin"
cat >"$3/bin/python" <<'END'
#!/usr/bin/env bash
echo "$*" >"$HOME/pip.log"
printf '#!/bin/sh\\n' >.uv/bin/uv
chmod +x .uv/bin/uv
END
chmod +x "$3/bin/python"
"""


def write_script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


class Checkout:
    """A copy of the files that the scripts read, with an own HOME and an own first folder on PATH."""

    def __init__(self, folder: Path) -> None:
        self.repo, self.home, self.bin = folder / "repo", folder / "home", folder / "bin"
        for name in COPIED:
            (self.repo / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, self.repo / name)
        write_script(
            self.bin / "uv", "#!/bin/sh\necho 'uv: command not found' >&2\nexit 127\n"
        )  # a dead shim
        write_script(self.home / ".local/bin/uv", FAKE_UV)

    def run(self, script: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"HOME": str(self.home), "PATH": f"{self.bin}:/usr/bin:/bin"}
        return subprocess.run(
            [self.repo / script], env=environment, capture_output=True, text=True, check=False
        )

    def uv_calls(self) -> list[str]:
        log = self.home / "uv.log"
        return [line for line in log.read_text().splitlines() if line != "--version"] if log.exists() else []


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path)


def test_without_a_working_uv_one_is_installed_into_a_private_environment(checkout: Checkout) -> None:
    assert checkout.run("scripts/find_uv.sh").stdout.strip() == str(checkout.home / ".local/bin/uv")
    (checkout.home / ".local/bin/uv").unlink()
    write_script(checkout.bin / "python3", FAKE_PYTHON3)
    assert checkout.run("scripts/find_uv.sh").stdout.strip() == ".uv/bin/uv"
    assert (checkout.home / "pip.log").read_text().startswith("-m pip install")


def test_a_python_without_venv_is_answered_with_the_line_that_installs_it(checkout: Checkout) -> None:
    (checkout.home / ".local/bin/uv").unlink()
    write_script(checkout.bin / "python3", "#!/bin/sh\nmkdir -p .uv\nexit 1\n")
    found = checkout.run("scripts/find_uv.sh")
    assert found.returncode == 1
    assert "apt-get install -y python3-venv" in found.stderr
    assert not (checkout.repo / ".uv").exists()


def test_set_up_makes_the_environment_once_and_installs_again_when_the_lock_changes(
    checkout: Checkout,
) -> None:
    assert checkout.run("scripts/setup.sh").returncode == 0
    calls = checkout.uv_calls()
    assert [call.split()[0] for call in calls] == ["venv", "pip", "pip"]
    assert "--requirements requirements.lock" in calls[1]
    assert calls[2].endswith("--editable . --editable envs --editable policies --editable robots")
    assert checkout.run("scripts/setup.sh").returncode == 0
    assert checkout.uv_calls() == calls
    (checkout.repo / "requirements.lock").write_text("numpy==2.2.6\n")
    checkout.run("scripts/setup.sh")
    assert checkout.uv_calls() == [*calls, *calls[1:]]


def test_set_up_replaces_an_environment_that_was_moved_here(checkout: Checkout) -> None:
    checkout.run("scripts/setup.sh")
    calls = checkout.uv_calls()
    checkout.repo = checkout.repo.rename(checkout.repo.with_name("moved"))
    checkout.run("scripts/setup.sh")
    assert checkout.uv_calls() == [*calls, *calls]


def test_set_up_that_failed_halfway_is_repeated(checkout: Checkout) -> None:
    write_script(checkout.home / ".local/bin/uv", FAKE_UV + "[[ $1 != pip ]]\n")
    assert checkout.run("scripts/setup.sh").returncode != 0
    write_script(checkout.home / ".local/bin/uv", FAKE_UV)
    assert checkout.run("scripts/setup.sh").returncode == 0
    assert checkout.uv_calls()[-1].endswith("--editable robots")
