"""Outcomes without an episode, for tests of what is made of them."""

from dataclasses import replace

from lerobot_env_bimanual.experts.evidence import Evidence
from lerobot_env_bimanual.experts.outcome import MoveReport, Outcome
from lerobot_env_bimanual.experts.strain import Strain

NO_STRAIN = Strain(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, "")
SOLVED = Outcome(
    task="lift_ball",
    variation=0,
    split="test",
    seed=0,
    success=True,
    failure="",
    last_move="lift",
    unmet=(),
    keyposes=(MoveReport("beside", (0.0,) * 18, 20, (1.0, 2.0), arrived=True),),
    ticks=20,
    draws=1,
    line_fallbacks=0,
    unstable=False,
    state_hash="00",
    evidence=Evidence(keyframes_found=True, replayed=True, strain=NO_STRAIN),
)
FAILED = replace(SOLVED, success=False, failure="no move left", unmet=("above(ball)",), evidence=None)


def episodes(solved: int, failed: int) -> list[Outcome]:
    return [replace(o, seed=seed) for seed, o in enumerate([SOLVED] * solved + [FAILED] * failed)]
