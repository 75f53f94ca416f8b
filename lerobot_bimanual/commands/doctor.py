"""The verb `doctor`."""

import sys
from dataclasses import dataclass

from lerobot_bimanual.health import Level, examine

COLORS = {Level.OK: "green", Level.INFO: "blue", Level.WARN: "yellow", Level.FAIL: "bold red"}

PATIENCE = "examining; importing LeRobot takes up to half a minute of it"

LEVEL_WIDTH, SUBJECT_WIDTH = 5, 23
"""Columns of the findings, in characters."""


@dataclass
class DoctorConfig:
    """The doctor has no flags."""


def doctor(config: DoctorConfig) -> int:
    """Check this machine and say how to mend what is missing.

    Looks at Python, package versions, LeRobot's discovery of our plugins, off-screen OpenGL, video decoding,
    processor and GPU. Exits with 1 if something that the project cannot work without is missing.

    Examples:
        lerobot-bimanual doctor
    """
    from rich.console import Console
    from rich.text import Text

    console, findings = Console(), []
    if not console.is_terminal:  # where no status is shown
        print(PATIENCE, file=sys.stderr, flush=True)
    with console.status(PATIENCE):
        for finding in examine():  # each is shown when it is found, for some take long
            findings.append(finding)
            level = Text(f"{finding.level:<{LEVEL_WIDTH}}", COLORS[finding.level])
            console.print(level, f"{finding.subject:<{SUBJECT_WIDTH}}", Text(finding.detail), soft_wrap=True)
            console.file.flush()
    for finding in findings:
        if finding.remedy:
            # unwrapped, so that a command can be copied in one piece
            console.print(Text(f"\n{finding.subject}: {finding.remedy}"), soft_wrap=True)
    return 1 if any(finding.level is Level.FAIL for finding in findings) else 0
