"""The checks behind `lerobot-bimanual doctor`."""

import importlib.metadata as metadata
import subprocess

import pytest

from lerobot_bimanual import health
from lerobot_bimanual.commands.doctor import DoctorConfig, doctor
from lerobot_bimanual.health import Finding, Level


def pretend_versions(monkeypatch: pytest.MonkeyPatch, **versions: str | None) -> None:
    """Make distributions appear in other versions; None makes one appear to be absent."""
    real = metadata.version

    def version(name: str) -> str:
        found = versions.get(name, real(name))
        if found is None:
            raise metadata.PackageNotFoundError(name)
        return found

    monkeypatch.setattr(health.metadata, "version", version)


def test_this_environment_satisfies_every_declared_version() -> None:
    findings = [health.check_python(), *health.check_distributions(), *health.check_versions()]
    assert {finding.level for finding in findings} == {Level.OK}
    assert {finding.subject for finding in findings} >= set(health.WATCHED)


def test_a_version_outside_the_declared_range_fails_with_the_command_that_mends_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretend_versions(monkeypatch, mujoco="4.0.0", frankik=None)
    findings = {finding.subject: finding for finding in health.check_versions()}
    assert findings["mujoco"].level is Level.FAIL
    assert findings["mujoco"].remedy == "pip install 'mujoco!=4.0.0,~=3.17.0'"
    assert findings["frankik"].level is Level.FAIL
    assert findings["numpy"].level is Level.OK


def test_an_absent_plugin_is_a_warning_and_a_plugin_of_another_version_a_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretend_versions(monkeypatch, lerobot_env_bimanual=None, lerobot_policy_bimanual="9.9")
    findings = {finding.subject: finding.level for finding in health.check_distributions()}
    assert findings[health.ENVS] is Level.WARN
    assert findings[health.POLICIES] is Level.FAIL
    assert "mujoco" not in {finding.subject for finding in health.check_versions()}
    assert health.check_gl().level is Level.INFO


def test_off_screen_rendering_works_here() -> None:
    finding = health.check_gl()
    assert finding.level is Level.OK, finding


def test_missing_opengl_fails_with_the_line_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    dead = subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: libEGL.so.1 not found\n")
    monkeypatch.setattr(health.subprocess, "run", lambda *_, **__: dead)
    finding = health.check_gl()
    assert (finding.level, finding.detail) == (Level.FAIL, "ImportError: libEGL.so.1 not found")
    assert "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri" in finding.remedy


@pytest.mark.parametrize(
    ("level", "code"), [(Level.OK, 0), (Level.INFO, 0), (Level.WARN, 0), (Level.FAIL, 1)]
)
def test_doctor_prints_findings_and_remedies_and_fails_only_on_failures(
    level: Level, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    finding = Finding("OpenGL", level, "none [of any kind]", "sudo apt-get install " + "x" * 100)
    monkeypatch.setattr("lerobot_bimanual.commands.doctor.examine", lambda: iter([finding]))
    assert doctor(DoctorConfig()) == code
    out = capsys.readouterr().out
    assert f"{level}" in out
    assert "none [of any kind]" in out
    assert f"OpenGL: {finding.remedy}\n" in out


def test_doctor_speaks_before_it_looks_at_anything(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    heard: list[str] = []

    def examine():
        heard.append(capsys.readouterr().err)
        yield Finding("Python", Level.OK, "3.12")

    monkeypatch.setattr("lerobot_bimanual.commands.doctor.examine", examine)
    doctor(DoctorConfig())
    assert "importing LeRobot" in heard[0]


def test_doctor_shows_each_finding_before_it_looks_at_the_next(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def examine():
        yield Finding("Python", Level.OK, "3.12")
        assert "Python" in capsys.readouterr().out
        yield Finding("OpenGL", Level.OK, "fine")

    monkeypatch.setattr("lerobot_bimanual.commands.doctor.examine", examine)
    doctor(DoctorConfig())
    assert "OpenGL" in capsys.readouterr().out


def test_a_check_that_breaks_is_a_finding_and_the_others_and_their_remedies_are_still_told(
    monkeypatch, capsys
):
    def broken() -> Finding:
        raise ModuleNotFoundError("No module named 'lerobot.envs.configs'")

    for name in ("check_gl", "check_video", "check_gpu"):
        monkeypatch.setattr(health, name, lambda: Finding("x", Level.OK, "fine"))
    monkeypatch.setattr(health, "check_plugins", broken)
    pretend_versions(monkeypatch, mujoco="4.0.0")
    assert doctor(DoctorConfig()) == 1
    told = capsys.readouterr().out
    assert "ModuleNotFoundError: No module named 'lerobot.envs.configs'" in told
    assert "plugins: make setup" in told
    assert "mujoco: pip install" in told


def test_a_driver_that_hangs_does_not_hang_the_doctor(monkeypatch):
    monkeypatch.setattr(health, "PATIENCE_S", 0.1)
    monkeypatch.setattr(health, "RENDER_8X8", "import time; time.sleep(60)")
    finding = health.check_gl()
    assert (finding.level, finding.detail) == (Level.FAIL, "no image within 0.1 s")
