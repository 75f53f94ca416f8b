"""Scripts of many commands end when one of them was interrupted, and continue when one has failed."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
VARIABLES = {"TASKS": "lift_ball push_box", "PATH": "/usr/bin:/bin"}


@pytest.mark.parametrize("name", ["board", "expert_reports"])
@pytest.mark.parametrize(("code", "goes_on"), [(130, False), (143, False), (1, True)])
def test_a_script_ends_where_it_was_stopped(name: str, code: int, goes_on: bool, tmp_path: Path) -> None:
    script = tmp_path / "scripts" / f"{name}.sh"
    script.parent.mkdir()
    shutil.copy(ROOT / "scripts" / script.name, script)
    programs = tmp_path / ".venv/bin"
    programs.mkdir(parents=True)
    for program in ("lerobot-bimanual", "python"):
        (programs / program).write_text(f'#!/bin/sh\necho "$@" >>calls\n[ "$1" = report ] || exit {code}\n')
        (programs / program).chmod(0o755)
    (programs / "python").write_text("#!/bin/sh\n")

    done = subprocess.run([script], env=VARIABLES, capture_output=True, text=True, check=False)

    assert done.returncode == (1 if goes_on else code), done.stderr
    assert (len((tmp_path / "calls").read_text().splitlines()) > 1) == goes_on
