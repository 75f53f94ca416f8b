"""The checks of `lerobot-bimanual doctor`, on this machine and on broken ones."""

import importlib.metadata as metadata
import subprocess
import sys

import pytest

from lerobot_bimanual.commands import doctor as command
from lerobot_bimanual.commands.doctor import DoctorConfig, Finding, Level, doctor


def pretend_versions(monkeypatch: pytest.MonkeyPatch, **versions: str | None) -> None:
    """Make distributions appear in other versions; None makes one appear to be absent."""
    real = metadata.version

    def version(name: str) -> str:
        found = versions.get(name, real(name))
        if found is None:
            raise metadata.PackageNotFoundError(name)
        return found

    monkeypatch.setattr(command.metadata, "version", version)


def pretend_findings(monkeypatch: pytest.MonkeyPatch, *findings: Finding) -> None:
    monkeypatch.setattr(command, "examine", lambda: iter(findings))


@pytest.mark.slow
def test_this_machine_is_in_order_and_every_plugin_is_discovered() -> None:
    words = [sys.executable, "-m", "lerobot_bimanual.cli", "doctor"]
    child = subprocess.run(words, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stdout + child.stderr
    assert child.stderr.endswith("next: lerobot-bimanual demo\n")
    lines = child.stdout.splitlines()
    found = {line.split(maxsplit=2)[1]: line for line in lines if line.startswith(("ok", "info"))}
    assert {*command.WATCHED} <= found.keys()
    for subject, text in {
        "environment": "bimanual",
        "policy": "peract2",
        "robot": "bimanual_sim",
        "OpenGL": "MUJOCO_GL=",
    }.items():
        assert text in found[subject]


def test_a_wrong_version_fails_with_the_command_that_mends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_versions(monkeypatch, mujoco="4.0.0", frankik=None)
    findings = {finding.subject: finding for finding in command.check_versions()}
    assert findings["mujoco"].remedy == "pip install 'mujoco!=4.0.0,~=3.17.0'"
    levels = {name: findings[name].level for name in ("mujoco", "frankik", "numpy")}
    assert levels == {"mujoco": Level.FAIL, "frankik": Level.FAIL, "numpy": Level.OK}


def test_an_absent_plugin_is_a_warning_and_one_of_another_version_a_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretend_versions(monkeypatch, lerobot_env_bimanual=None, lerobot_policy_bimanual="9.9")
    findings = {finding.subject: finding.level for finding in command.check_distributions()}
    assert (findings[command.ENVS], findings[command.POLICIES]) == (Level.WARN, Level.FAIL)
    assert "mujoco" not in {finding.subject for finding in command.check_versions()}
    assert [finding.level for finding in command.check_gl()] == [Level.INFO]


def test_missing_opengl_fails_with_the_line_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    dead = subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: libEGL.so.1 not found\n")
    monkeypatch.setattr(command.subprocess, "run", lambda *_, **__: dead)
    (finding,) = command.check_gl()
    assert (finding.level, finding.detail) == (Level.FAIL, "ImportError: libEGL.so.1 not found")
    assert "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri" in finding.remedy


def test_a_driver_that_hangs_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "RENDER_TIMEOUT_S", 0.1)
    monkeypatch.setattr(command, "RENDER_8X8", "import time; time.sleep(60)")
    (finding,) = command.check_gl()
    assert (finding.level, finding.detail) == (Level.FAIL, "no image within 0.1 s")


@pytest.mark.parametrize(
    ("level", "code"), [(Level.OK, 0), (Level.INFO, 0), (Level.WARN, 0), (Level.FAIL, 1)]
)
def test_findings_and_remedies_are_printed_and_only_failures_fail(
    level: Level, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    finding = Finding("OpenGL", level, "none [of any kind]", "sudo apt-get install " + "x" * 100)
    pretend_findings(monkeypatch, finding)
    assert doctor(DoctorConfig()) == code
    printed = capsys.readouterr()
    assert f"{level}" in printed.out
    assert "none [of any kind]" in printed.out
    assert f"OpenGL: {finding.remedy}\n" in printed.out
    assert printed.err.startswith("examining; importing LeRobot")


def test_a_check_that_breaks_is_a_finding_and_the_others_go_on(monkeypatch, capsys):
    def broken():
        raise ModuleNotFoundError("No module named 'lerobot.envs.configs'")

    for name in ("check_gl", "check_video", "check_gpu"):
        monkeypatch.setattr(command, name, lambda: iter(()))
    monkeypatch.setattr(command, "check_plugins", broken)
    pretend_versions(monkeypatch, mujoco="4.0.0")
    assert doctor(DoctorConfig()) == 1
    printed = capsys.readouterr().out
    assert "ModuleNotFoundError: No module named 'lerobot.envs.configs'" in printed
    assert "plugins: make setup" in printed
    assert "mujoco: pip install" in printed
