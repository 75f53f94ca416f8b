"""A made-up ladder, two axes and a policy that falls along one of them; and a certificate of rungs."""

from dataclasses import replace

from lerobot_bimanual.ladder.result import AxisRecord, LadderResult, Rung, RungEpisode
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.versions import SIMULATION_PACKAGES


def rung(axis: str, level: int, outcomes: str, expert: str = "", blind: str = "", certificate=None) -> Rung:
    """One episode per letter, `x` solved and `.` not; without letters the expert solves all, and the blind control none."""
    return Rung(
        axis,
        level,
        world=f"{axis}{level}",
        expert=solved(expert or "x" * len(outcomes)),
        blind=solved(blind),
        certificate=certificate,
        episodes=tuple(
            RungEpisode(seed, seed % 2, letter == "x", "" if letter == "x" else "out of time", 5, 120)
            for seed, letter in enumerate(outcomes)
        ),
    )


def solved(outcomes: str) -> tuple[int, ...]:
    return tuple(seed for seed, letter in enumerate(outcomes) if letter == "x")


AXES = (
    AxisRecord("camera_moved", "seen", "degrees", (2.0, 5.0, 10.0)),
    AxisRecord("mass", "bodies", "times the mass", (1.2, 1.5, 2.0)),
)
LADDER = LadderResult(
    schema_version=1,
    task="lift_ball",
    policy="mine",
    checkpoint="outputs/mine",
    checkpoint_sha256="0f" * 32,
    options={"split": "test", "variation": "any"},
    batch_size=2,
    versions=dict.fromkeys(SIMULATION_PACKAGES, "3"),
    date="2026-01-31",
    axes=AXES,
    not_applicable=("door_stiffness",),
    rungs=(
        rung("", 0, "xxxxxxxxxx", blind="x........."),
        rung("camera_moved", 1, "xxxxxxxxx."),
        rung("camera_moved", 2, "xxxx......"),
        rung("camera_moved", 3, ".........."),
        rung("mass", 1, "xxxxxxxxxx"),
        rung("mass", 2, "xxxxxxxx.."),
        rung("mass", 3, "xx........", expert="xxxx......"),
    ),
)

CERTIFICATE = RungCertificate(
    schema_version=2,
    task="lift_ball",
    split="test",
    expert_seeds=(100, 200),
    blind_seeds=(100, 130),
    versions={"mujoco": "3"},
    axes=AXES[1:],
    not_applicable=("stiffness",),
    rungs=(
        CertifiedRung("", 0, "00", (), ()),
        CertifiedRung("mass", 1, "01", (103, 150, 199), (101,)),
        CertifiedRung("mass", 3, "03", (100, 101, 102, 103), ()),
    ),
)


def ladder(**changes) -> LadderResult:
    return replace(LADDER, **changes)
