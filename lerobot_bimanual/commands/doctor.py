"""The command `doctor`: checks of the machine and of the installed distributions."""

import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from lerobot_bimanual.distributions import installed_version
from lerobot_bimanual.resources import usable_cores, usable_memory
from lerobot_bimanual.terminal import show_next

CORE = "lerobot_bimanual"
PLUGINS = ("lerobot_env_bimanual", "lerobot_policy_bimanual", "lerobot_robot_bimanual")
SHARED = Path("/dev/shm")
MIN_SHARED_BYTES = 500_000_000
"""Docker gives 64 MB, which a few batches of RGB-D images fill."""
REPAIR = "make setup, or in your own environment: pip install -e . -e envs -e policies -e robots"
RENDER_TIMEOUT_S = 120
"""An OpenGL driver may hang."""
# Runs in its own process, because a broken OpenGL driver can take the process with it.
RENDER_8X8 = """
import os
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene
with Renderer(Scene(), ("front",), 8, 8) as renderer:
    assert renderer.render()["front"][0].any(), "the image is black"
print("off-screen image rendered, MUJOCO_GL=" + os.environ.get("MUJOCO_GL", ""))
"""
COLORS = {"ok": "green", "info": "blue", "warn": "yellow", "fail": "bold red"}
"""Levels of findings: nothing is wrong, worth knowing, a part will not work, the project will not work."""


class Finding(NamedTuple):
    """What was checked, how serious it is (a key of `COLORS`), what was found, and how to mend it, if there is need."""

    subject: str
    level: str
    detail: str
    remedy: str = ""


@dataclass
class DoctorConfig:
    """The doctor has no flags."""


def doctor(config: DoctorConfig) -> int:
    """Check this machine and say how to fix what is missing.

    Checks Python, package versions, off-screen OpenGL, GPU and disk.
    Exits with 1 if something that the project cannot work without is missing.

    Examples:
        lerobot-bimanual doctor
    """
    from rich.console import Console
    from rich.text import Text

    console, findings = Console(), []
    for check in (check_packages, check_machine, check_gl):
        try:
            found = [*check()]
        except Exception as error:  # a broken installation may break one check in any way, but not the others
            subject = check.__name__.removeprefix("check_")
            found = [Finding(subject, "fail", f"{type(error).__name__}: {error}", REPAIR)]
        for subject, level, detail, _ in found:
            console.print(Text(f"{level:<5}", COLORS[level]), f"{subject:<23}", Text(detail), soft_wrap=True)
        findings += found
    for finding in findings:
        if finding.remedy:
            # unwrapped, so that a command can be copied in one piece
            console.print(Text(f"\n{finding.subject}: {finding.remedy}"), soft_wrap=True)
    if any(finding.level == "fail" for finding in findings):
        return 1
    show_next("lerobot-bimanual", "policy", "benchmark", "--device=cpu")
    return 0


def check_packages() -> Iterator[Finding]:
    """Python, our distributions and the packages that they need, against the ranges that they declare."""
    from packaging.requirements import Requirement
    from packaging.specifiers import SpecifierSet
    from packaging.utils import canonicalize_name

    with_lerobot = any(map(installed_version, ("lerobot", *PLUGINS[1:])))
    extras = ("", "lerobot") if with_lerobot else ("",)
    ranges = {"Python": SpecifierSet(metadata.metadata(CORE)["Requires-Python"])}
    for distribution in (CORE, *PLUGINS):
        if installed_version(distribution) is None:
            yield Finding(distribution, "warn", "not installed", REPAIR)
            continue
        ranges.setdefault(canonicalize_name(distribution), SpecifierSet())
        for requirement in map(Requirement, metadata.requires(distribution) or []):
            if requirement.marker is None or any(requirement.marker.evaluate({"extra": e}) for e in extras):
                name = canonicalize_name(requirement.name)
                ranges[name] = ranges.get(name, SpecifierSet()) & requirement.specifier
    if not with_lerobot:
        remedy = "for datasets, training and evaluation: pip install 'lerobot_env_bimanual[lerobot]'"
        yield Finding("lerobot", "info", "not installed; environments and experts work without it", remedy)
    for package, needed in ranges.items():
        installed = platform.python_version() if package == "Python" else installed_version(package)
        if installed is not None and needed.contains(installed, prereleases=True):
            yield Finding(package, "ok", installed)
        else:
            found = "not installed" if installed is None else f"{installed}, but {needed} is needed"
            remedy = "make setup" if package == "Python" else f"pip install '{package}{needed}'"
            yield Finding(package, "fail", found, remedy)


def check_machine() -> Iterator[Finding]:
    """What this process may use: cores, memory, disk, and a CUDA device for training at full size."""
    free = f"{usable_memory() / 1e9:.0f} GB memory free, {shutil.disk_usage('.').free / 1e9:.0f} GB free here"
    yield Finding("machine", "info", f"{usable_cores()} cores, {free}")
    if SHARED.is_dir() and (shared := shutil.disk_usage(SHARED).total) < MIN_SHARED_BYTES:
        remedy = "in a container: docker run --shm-size=2g; or train with --num_workers=0 and evaluate with synchronous environments"
        yield Finding(str(SHARED), "warn", f"{shared / 1e6:.0f} MB; workers pass images through it", remedy)
    if sys.dont_write_bytecode:
        remedy = "unset PYTHONDONTWRITEBYTECODE, or: python -m compileall -q " + sys.prefix
        yield Finding(
            "byte code", "info", "not kept: every program compiles LeRobot anew, for ten seconds", remedy
        )
    if installed_version("torch") is None:
        return
    import torch

    names = [torch.cuda.get_device_name(index) for index in range(torch.cuda.device_count())]
    detail = ", ".join(names) or "none: simulation and small policies run on the processor"
    yield Finding("GPU", "ok" if names else "info", detail)


def check_gl() -> Iterator[Finding]:
    """Off-screen rendering of an 8 x 8 image, in another process, where environments are installed."""
    if installed_version(PLUGINS[0]) is None:
        return
    command = [sys.executable, "-c", RENDER_8X8]
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=True, timeout=RENDER_TIMEOUT_S)
        yield Finding("OpenGL", "ok", child.stdout.strip())
    except subprocess.TimeoutExpired:
        hint = "perhaps with another GPU, MUJOCO_EGL_DEVICE_ID=1"
        yield Finding("OpenGL", "fail", f"no image within {RENDER_TIMEOUT_S} s; {hint}")
    except subprocess.CalledProcessError as error:
        problem = (error.stderr.strip().splitlines() or [f"the process ended with {error.returncode}"])[-1]
        yield Finding("OpenGL", "fail", problem.removeprefix("lerobot_env_bimanual.gl.MissingGL: "))
