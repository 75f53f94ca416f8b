"""The checks of `lerobot-bimanual doctor`, on this machine and on broken ones."""

import subprocess
from unittest.mock import Mock

import pytest

from lerobot_bimanual.commands import doctor as command
from lerobot_bimanual.commands.doctor import DoctorConfig, doctor


def test_wrong_and_absent_packages_come_with_the_command_that_mends_them(monkeypatch):
    others = {"mujoco": "5.0.0", "frankik": None, "lerobot_policy_bimanual": None}
    real = command.installed_version
    monkeypatch.setattr(command, "installed_version", lambda name: others.get(name, real(name)))
    findings = {finding.subject: finding for finding in command.check_packages()}
    assert findings["mujoco"].remedy == "pip install 'mujoco<5,>=3.10'"
    names = ("mujoco", "frankik", "numpy", "lerobot_policy_bimanual")
    assert [findings[name].level for name in names] == ["fail", "fail", "ok", "warn"]
    assert [name for name in findings if name.replace("-", "_") == "lerobot_bimanual"] == ["lerobot-bimanual"]


@pytest.mark.parametrize(
    ("program", "limit_s", "detail"),
    [
        ("raise RuntimeError('driver broken')", 60, "RuntimeError: driver broken"),
        ("import time; time.sleep(60)", 1, "no image within 1 s; perhaps with another GPU"),
    ],
)
def test_opengl_that_fails_or_hangs_is_a_finding(program, limit_s, detail, monkeypatch):
    monkeypatch.setattr(command, "RENDER_8X8", program)
    monkeypatch.setattr(command, "RENDER_TIMEOUT_S", limit_s)
    (finding,) = command.check_gl()
    assert finding.level == "fail"
    assert finding.detail.startswith(detail)


def test_a_check_that_breaks_is_a_finding_and_the_others_go_on(monkeypatch, capsys):
    monkeypatch.setattr(subprocess, "run", Mock(side_effect=OSError("broken")))
    assert doctor(DoctorConfig()) == 1
    printed = capsys.readouterr().out
    assert "OSError: broken" in printed
    assert "gl: make setup" in printed
    assert "GPU" in printed


def test_too_little_shared_memory_and_byte_code_that_is_not_kept_are_findings(monkeypatch):
    monkeypatch.setattr(command, "MIN_SHARED_BYTES", 10**18)
    monkeypatch.setattr(command.sys, "dont_write_bytecode", True)
    findings = {finding.subject: finding for finding in command.check_machine()}
    assert "--shm-size" in findings["/dev/shm"].remedy
    assert "PYTHONDONTWRITEBYTECODE" in findings["byte code"].remedy
