"""`lerobot-bimanual doctor` on the machine of the tests."""

import subprocess
import sys

import pytest


@pytest.mark.slow
def test_doctor_finds_this_machine_in_order_and_every_plugin_discovered() -> None:
    command = [sys.executable, "-m", "lerobot_bimanual.cli", "doctor"]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stdout + child.stderr
    found = {
        line.split(maxsplit=2)[1]: line
        for line in child.stdout.splitlines()
        if line.startswith(("ok", "info"))
    }
    assert "bimanual" in found["environment"]
    assert "peract2" in found["policy"]
    assert "bimanual_sim" in found["robot"]
    assert "MUJOCO_GL=" in found["OpenGL"]
