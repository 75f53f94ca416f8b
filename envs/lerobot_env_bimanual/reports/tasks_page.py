"""The page of all tasks: what was measured of experts, controls, arms and cameras, from certificates."""

from __future__ import annotations

from pathlib import Path

from lerobot_env_bimanual.experts.world_version import joint_version
from lerobot_env_bimanual.reports.certified import (
    EXACT,
    NOT_MEASURED,
    ROUNDED,
    Certified,
    evidence_table,
    excess_sentence,
    paper_table,
    strain_table,
    success_table,
)
from lerobot_env_bimanual.reports.visibility import Visibility, visibility_section

PAGE = """\
# The tasks, measured

Written by `lerobot-bimanual expert report` from the certificates in `{folder}`; do not edit.

World `{world}`, MuJoCo {mujoco}; {split} seeds {seeds}, every variation on each of them.

## Experts and controls

Successes of episodes. *Rounded* keyposes lie on a grid of {voxels} voxels per axis and on bins of 5 degrees, like those
a policy predicts. *Blind* plays the mean keyposes of 30 training episodes of the variation, whatever the scene; *random*
plays keyposes from the whole workspace. *Unread* plays the right keyposes for one of the instructions that the scene allows, drawn
at random; *chance* is one in the number of these instructions.

{success}

## What else was found out about the experts' episodes

Each was played again, tick by tick, from its recorded joint actions, and every state compared. A tip error is the
distance of a hand from its target at the end of a keypose, but for the one at which the episode ended; in
`lift_ball` it is the squeeze of the ball. A placement that is drawn is accepted if it is legal (nothing overlaps) and if
the expert's script can be gone through from there without physics, with exact and with rounded keyposes: all targets in
reach, lines straight, joints away from their limits, arms out of each other's way. Others are drawn anew, so an episode
is one that both arms can serve, and the rates are rates of those.

{evidence}

## What is asked of the arms

The largest value of any episode of the experts with exact keyposes, beside what a real Panda allows
(`lerobot_env_bimanual.robots.panda` and `lerobot_env_bimanual.experts.strain` give the sources); `certify` names every
episode that asks for more. {excess}

Torque is the motors', gravity included, over their limits of 87 and 12 N m, at every 2 ms; *a motor at its
limit* is the share of an episode's time in which any of the fourteen gives all it has. Velocity, acceleration and jerk are
those of the commanded joints over their limits, from one tick of 50 ms to the next. The contact force is the net force
between an arm and all that it touches, every 2 ms through a low pass of 10 Hz, the bandwidth that Franka states for its
force control. An arm stops where its user has set a threshold: libfranka's examples set 20 N for free motion and 100 N where
contact is meant, as it is here. Penetration is the deepest of any two bodies in each other at any step. *Rounded* keyposes
are off by up to half a voxel, so that a stiff arm presses harder on a handle that guides it; they are measured and not
limited.

{strain}

## Beside the paper

In brackets the paper's figures. Its durations count frames at 30 Hz, while frames are simulated at 20 Hz. Items here
are all things that can move, doors and drawers among them. The original's oracle replays ground-truth keyposes in the
original simulator; it is published for two tasks and on average.

{paper}

{visibility}"""


def tasks_page(certified: Certified, folder: Path, seen: Visibility | None) -> str:
    """The page as Markdown.

    Args:
        certified: the certificates.
        folder: where they lie, for the page to say.
        seen: what the cameras see, if that was measured; in the worlds of the certificates.
    """
    expert = certified.certificates[EXACT]
    rounded = certified.certificates.get(ROUNDED)
    return PAGE.format(
        folder=folder.as_posix(),
        world=joint_version(expert.worlds),
        mujoco=expert.versions["mujoco"],
        split=expert.campaign.split,
        seeds=expert.campaign.seeds,
        voxels=rounded.campaign.discretise if rounded else NOT_MEASURED,
        success=success_table(certified),
        evidence=evidence_table(certified),
        excess=excess_sentence(certified),
        strain=strain_table(certified),
        paper=paper_table(certified),
        visibility=visibility_section(seen) if seen else "",
    )
