"""The command `doctor`: checks of the machine and of the installed distributions.

Plugins are examined as LeRobot sees them, through distribution metadata and its registries: core imports none of them.
"""

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from importlib import metadata

from lerobot_bimanual.cli import show_next
from lerobot_bimanual.errors import MissingGL

CORE, ENVS, POLICIES = "lerobot_bimanual", "lerobot_env_bimanual", "lerobot_policy_bimanual"
ROBOTS = "lerobot_robot_bimanual"
# The packages whose version decides whether we work, or (MuJoCo) whether trajectories are the same.
WATCHED = ("lerobot", "mujoco", "gymnasium", "frankik", "torch", "numpy")
REPAIR = "make setup, or in your own environment: pip install -e . -e envs -e policies -e robots"
RENDER_TIMEOUT_S = 120
"""An OpenGL driver may hang."""
STATUS = "examining; importing LeRobot takes up to half a minute of it"
LEVEL_WIDTH, SUBJECT_WIDTH = 5, 23
"""Columns of the findings, in characters."""

# Runs in its own process, because a broken OpenGL driver can take the process with it.
RENDER_8X8 = f"""
import os
from {ENVS}.gl import mujoco
world = "<mujoco><worldbody><light pos='0 0 2'/><geom size='1'/></worldbody></mujoco>"
model = mujoco.MjModel.from_xml_string(world)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 8, 8) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any(), "the image is black"
print("off-screen image rendered, MUJOCO_GL=" + os.environ.get("MUJOCO_GL", ""))
"""


class Level(StrEnum):
    """How serious a finding is."""

    OK = "ok"
    INFO = "info"  # nothing is wrong, but worth knowing
    WARN = "warn"  # a part of the project will not work
    FAIL = "fail"  # the project will not work


COLORS = {Level.OK: "green", Level.INFO: "blue", Level.WARN: "yellow", Level.FAIL: "bold red"}


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Attributes:
        subject: what was checked.
        level: the verdict.
        detail: what was found.
        remedy: how to mend it; "" if nothing is to be done.
    """

    subject: str
    level: Level
    detail: str
    remedy: str = ""


@dataclass
class DoctorConfig:
    """The doctor has no flags."""


def doctor(config: DoctorConfig) -> int:
    """Check this machine and say how to mend what is missing.

    Checks Python, package versions, LeRobot's discovery of our plugins, off-screen OpenGL, video decoding,
    processor and GPU. Exits with 1 if something that the project cannot work without is missing.

    Examples:
        lerobot-bimanual doctor
    """
    from rich.console import Console
    from rich.text import Text

    console, findings = Console(), []
    if not console.is_terminal:  # where no status is shown
        print(STATUS, file=sys.stderr, flush=True)
    with console.status(STATUS):
        for finding in examine():  # each is shown when it is found, for some take long
            findings.append(finding)
            level = Text(f"{finding.level:<{LEVEL_WIDTH}}", COLORS[finding.level])
            console.print(level, f"{finding.subject:<{SUBJECT_WIDTH}}", Text(finding.detail), soft_wrap=True)
            console.file.flush()
    for finding in findings:
        if finding.remedy:
            # unwrapped, so that a command can be copied in one piece
            console.print(Text(f"\n{finding.subject}: {finding.remedy}"), soft_wrap=True)
    if any(finding.level is Level.FAIL for finding in findings):
        return 1
    show_next("lerobot-bimanual", "demo")
    return 0


def examine() -> Iterator[Finding]:
    """All findings, the quick ones first."""
    for subject, check in (
        ("Python", check_python),
        ("distributions", check_distributions),
        ("versions", check_versions),
        ("machine", check_machine),
        ("OpenGL", check_gl),
        ("plugins", check_plugins),
        ("video", check_video),
        ("GPU", check_gpu),
    ):
        try:
            yield from check()
        except Exception as error:  # a broken installation may break one check in any way, but not the others
            yield Finding(subject, Level.FAIL, f"{type(error).__name__}: {error}", REPAIR)


def check_python() -> Iterator[Finding]:
    """The interpreter against the range that our package declares."""
    from packaging.specifiers import SpecifierSet

    version = ".".join(map(str, sys.version_info[:3]))
    required = metadata.metadata(CORE)["Requires-Python"]
    if version in SpecifierSet(required):
        yield Finding("Python", Level.OK, version)
    else:
        yield Finding("Python", Level.FAIL, f"{version}, but {required} is needed", "make setup")


def check_distributions() -> Iterator[Finding]:
    """Our four distributions: core and, optionally, each plugin, all of one version."""
    core = metadata.version(CORE)
    yield Finding(CORE, Level.OK, core)
    for plugin in (ENVS, POLICIES, ROBOTS):
        installed = _version(plugin)
        if installed is None:
            yield Finding(plugin, Level.WARN, "not installed", REPAIR)
        elif installed != core:
            yield Finding(plugin, Level.FAIL, f"{installed}, but {CORE} is {core}", REPAIR)
        else:
            yield Finding(plugin, Level.OK, installed)


def check_versions() -> Iterator[Finding]:
    """Installed versions of the watched packages against the ranges that our distributions declare."""
    from packaging.requirements import Requirement
    from packaging.specifiers import SpecifierSet

    allowed: dict[str, SpecifierSet] = {}
    for distribution in (CORE, ENVS, POLICIES, ROBOTS):
        for line in (metadata.requires(distribution) or []) if _version(distribution) else []:
            requirement = Requirement(line)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                earlier = allowed.get(requirement.name, SpecifierSet())
                allowed[requirement.name] = earlier & requirement.specifier
    for package in (name for name in WATCHED if name in allowed):
        installed, remedy = _version(package), f"pip install '{package}{allowed[package]}'"
        if installed is None:
            yield Finding(package, Level.FAIL, "not installed", remedy)
        elif not allowed[package].contains(installed, prereleases=True):
            yield Finding(package, Level.FAIL, f"{installed}, but {allowed[package]} is needed", remedy)
        else:
            yield Finding(package, Level.OK, installed)


def check_machine() -> Iterator[Finding]:
    """Processor cores that this process may use, and memory."""
    cores = len(os.sched_getaffinity(0))
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    yield Finding("machine", Level.INFO, f"{cores} cores, {memory_gib:.0f} GiB memory")


def check_gl() -> Iterator[Finding]:
    """Off-screen rendering of an 8 x 8 image, in another process."""
    if _version(ENVS) is None:
        yield Finding("OpenGL", Level.INFO, f"not tried: {ENVS} is not installed")
        return
    command, remedy = [sys.executable, "-c", RENDER_8X8], str(MissingGL("rendering failed"))
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=RENDER_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        yield Finding("OpenGL", Level.FAIL, f"no image within {RENDER_TIMEOUT_S} s", remedy)
        return
    if child.returncode == 0:
        yield Finding("OpenGL", Level.OK, child.stdout.strip())
    else:
        reason = (child.stderr.strip().splitlines() or [f"the process ended with {child.returncode}"])[-1]
        yield Finding("OpenGL", Level.FAIL, reason, remedy)


def check_plugins() -> Iterator[Finding]:
    """Environment, policy and robot types after LeRobot's own plugin discovery."""
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.envs.configs import EnvConfig
    from lerobot.robots.config import RobotConfig
    from lerobot.utils.import_utils import register_third_party_plugins

    logging.disable(logging.CRITICAL)  # discovery logs tracebacks; the findings say the same in a line
    try:
        register_third_party_plugins()
    finally:
        logging.disable(logging.NOTSET)
    for kind, plugin, registry in (
        ("environment types", ENVS, EnvConfig),
        ("policy types", POLICIES, PreTrainedConfig),
        ("robot types", ROBOTS, RobotConfig),
    ):
        if _version(plugin) is None:
            continue
        choices = registry.get_known_choices().items()
        ours = [name for name, config in choices if config.__module__.partition(".")[0] == plugin]
        if ours:
            yield Finding(kind, Level.OK, ", ".join(sorted(ours)))
        else:
            remedy = f'python -c "import lerobot, {plugin}" shows why'
            yield Finding(kind, Level.FAIL, f"LeRobot found no type of {plugin}", remedy)


def check_video() -> Iterator[Finding]:
    """The decoder of dataset videos: torchcodec with FFmpeg's libraries, else PyAV."""
    try:
        import torchcodec.decoders  # noqa: F401
    except (ImportError, RuntimeError, OSError):
        detail = "torchcodec cannot load FFmpeg; datasets are decoded by PyAV, slower"
        yield Finding("video", Level.INFO, detail, "optional: sudo apt-get install ffmpeg")
    else:
        yield Finding("video", Level.OK, f"torchcodec {metadata.version('torchcodec')} with FFmpeg")


def check_gpu() -> Iterator[Finding]:
    """A CUDA device for training at full size."""
    import torch

    names = [torch.cuda.get_device_name(index) for index in range(torch.cuda.device_count())]
    if names:
        yield Finding("GPU", Level.OK, ", ".join(names))
    else:
        yield Finding("GPU", Level.INFO, "none: simulation and small policies run on the processor")


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
