"""The version of a world follows what it does, and nothing else."""

from dataclasses import replace

import pytest

from lerobot_env_bimanual.conditions import AtRest
from lerobot_env_bimanual.experts.world_version import VERSION_DIGITS, joint_version, world_version
from lerobot_env_bimanual.motion import planner
from lerobot_env_bimanual.tasks import lift_ball
from lerobot_env_bimanual.tasks.lift_ball import LiftBall
from lerobot_env_bimanual.world.scene import Scene

pytestmark = pytest.mark.sim
TASK = "lift_ball"


def version_now() -> str:
    """Played anew, whatever was played before."""
    return world_version.__wrapped__(TASK)


def test_every_task_has_its_own_short_one_whenever_it_is_asked_for_and_several_have_one_together():
    assert len(world_version(TASK)) == VERSION_DIGITS
    assert version_now() == world_version(TASK) != world_version("push_box")
    both = {"a": "1", "b": "2"}
    assert joint_version(both) == joint_version(dict(reversed(both.items()))) != joint_version({"a": "1"})


SPEC = LiftBall.spec


def ball(**changes):
    return replace(SPEC, props=(replace(lift_ball.BALL, **changes),))


CHANGES = {
    "friction": (LiftBall, "spec", ball(friction=0.31)),
    "mass": (LiftBall, "spec", ball(mass_kg=1.01)),
    "success": (LiftBall, "spec", replace(SPEC, success=SPEC.success[:1])),
    "instruction": (LiftBall, "spec", replace(SPEC, instructions=("lift it",))),
    "placement": (lift_ball, "AREA", replace(lift_ball.AREA, half_size_m=(0.17, 0.18))),
    "expert": (lift_ball, "APPROACH_GAP_M", 0.08),
    "motion": (planner, "REST_TICKS", 3),
    "settling": (Scene, "settle", lambda self: None),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_change_of_what_happens_changes_it(monkeypatch, change):
    before = world_version(TASK)
    monkeypatch.setattr(*change)
    assert version_now() != before


def test_a_threshold_that_the_probed_episode_never_meets_counts(monkeypatch):
    def with_rest(speed_m_s: float) -> str:
        monkeypatch.setattr(
            LiftBall, "spec", replace(SPEC, success=(*SPEC.success, AtRest("ball", speed_m_s)))
        )
        return version_now()

    assert with_rest(100.0) != with_rest(200.0)
