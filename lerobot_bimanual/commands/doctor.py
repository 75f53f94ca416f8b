"""The verb `doctor`."""

from dataclasses import dataclass

from lerobot_bimanual.health import Level, examine

COLORS = {Level.OK: "green", Level.INFO: "blue", Level.WARN: "yellow", Level.FAIL: "bold red"}


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
    from rich.table import Table
    from rich.text import Text

    console = Console()
    with console.status("examining (importing LeRobot takes a while)"):
        findings = list(examine())
    table = Table.grid(padding=(0, 2))
    for finding in findings:
        level = Text(finding.level, COLORS[finding.level])
        table.add_row(level, Text(finding.subject), Text(finding.detail))
    console.print(table)
    for finding in findings:
        if finding.remedy:
            # unwrapped, so that a command can be copied in one piece
            console.print(Text(f"\n{finding.subject}: {finding.remedy}"), soft_wrap=True)
    return 1 if any(finding.level is Level.FAIL for finding in findings) else 0
