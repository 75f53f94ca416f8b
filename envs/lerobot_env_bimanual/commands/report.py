"""The verb `report`: what the certificates say, as a page of documentation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

PAGE = """\
# The tasks, measured

Written by `lerobot-bimanual report` from the certificates in `{folder}`; do not edit.

World `{world}`, MuJoCo {mujoco}; {split} seeds {seeds}, every variation on each of them.

## Experts and controls

Successes of episodes. *Rounded* keyposes lie on a grid of {voxels} voxels per axis and on bins of 5 degrees, like those
a policy predicts. *Blind* plays the mean keyposes of 30 training episodes of the variation, whatever the scene; *random*
plays keyposes from the whole workspace. *One arm* is the better of the two arms alone, the other one resting at home with
its hand open: a script that knows the scene's state, written to beat the task, which may choose among its ways by trying
them in a copy of the episode. *Unread* plays the right keyposes for one of the instructions that the scene allows, drawn
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
(`lerobot_env_bimanual.robots.panda` and `lerobot_env_bimanual.expert.strain` give the sources); `certify` names every
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

## How the arms depend on each other

The paper sorts its tasks by hand; the other columns are measured in the experts' episodes: how long both hands
touch the same object, the force that one arm passes to the other through it, the share of moving time in which both
hands move, the correlation of their speeds, and how alike their motions are when one is mirrored (1 mirror images, -1
one follows the other).

{coupling}
{visibility}"""

VISIBILITY = """\

## What the cameras see

Written by `scripts/visibility.py` from {split} seeds {seeds}. The *target* of an arm is the part of an object, within
{near_cm:.0f} cm, that its fingers are next to at the end of a move; it counts as seen in a view before that move if at least
{pixels} of {size} x {size} pixels show it. What a hand carries is its target only if the hand brings it to nothing else.

{targets}

Pixels of the objects in each view, medians: at the start / over the start and all keyposes but the last.

{objects}
"""


@dataclass
class ReportConfig:
    """Options of the verb `report`."""

    certificates: Path = Path("results/certificates")  # folder of the files that `certify` has written
    visibility: Path = Path(
        "results/visibility.json"
    )  # what `scripts/visibility.py` has written, if it is there
    output: Path | None = None  # Markdown file; without it the page is printed


def report(config: ReportConfig) -> None:
    """Write the measured table of all tasks, beside the paper's, from certificates.

    Every certificate is checked first, by itself and against that of the experts: who played which episodes, in which
    world and with which versions, and all that follows from the episodes. Nothing is written if one is wrong.

    Examples:
        lerobot-bimanual report
        lerobot-bimanual report --output=docs/tasks.md
    """
    from lerobot_bimanual.markdown_table import write_page
    from lerobot_bimanual.output_file import check_output_file
    from lerobot_env_bimanual.expert.world_version import joint_version
    from lerobot_env_bimanual.reports import certified as tables

    if config.output is not None:
        check_output_file(config.output)
    certified = tables.Certified.read(config.certificates)
    expert = certified.certificates[tables.EXACT]
    rounded = certified.certificates.get(tables.ROUNDED)
    page = PAGE.format(
        folder=config.certificates.as_posix(),
        world=joint_version(expert.worlds),
        mujoco=expert.versions["mujoco"],
        split=expert.campaign.split,
        seeds=expert.campaign.seeds,
        voxels=rounded.campaign.discretise if rounded else tables.NOT_MEASURED,
        success=tables.success_table(certified),
        evidence=tables.evidence_table(certified),
        excess=tables.excess_sentence(certified),
        strain=tables.strain_table(certified),
        paper=tables.paper_table(certified),
        coupling=tables.coupling_table(certified),
        visibility=_visibility(config.visibility, expert.worlds) if config.visibility.exists() else "",
    )
    write_page(page, config.output)


def _visibility(path: Path, worlds: Mapping[str, str]) -> str:
    from lerobot_bimanual.errors import BimanualError
    from lerobot_env_bimanual.pictures.visibility import IMAGE_SIZE, MIN_PIXELS, NEAR_M
    from lerobot_env_bimanual.reports.visibility import Visibility, pixels_table, targets_table

    visibility = Visibility.read(path)
    if visibility.worlds != worlds:
        raise BimanualError(
            f"{path} was measured in other worlds than the certificates; run scripts/visibility.py again"
        )
    return VISIBILITY.format(
        split=visibility.split,
        seeds=visibility.seeds,
        near_cm=100 * NEAR_M,
        pixels=MIN_PIXELS,
        size=IMAGE_SIZE,
        targets=targets_table(visibility),
        objects=pixels_table(visibility),
    )
