"""The two views of an episode: which rows each stores, and what a row holds."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import JOINTS_PER_ARM
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.joint_action import CONTROL_HZ, by_arm


def rows_of_view(episode: Demonstration, view: View, intermediate: Sequence[float] = ()) -> list[int]:
    """Rows of an episode that a view stores, ascending.

    Args:
        episode: T ticks, so rows 0 to T.
        view: "frames" stores the row before every tick; "keyframes" stores row 0, the first row of every stage,
            and row T.
        intermediate: fractions between 0 and 1 of each stage's motion at which "keyframes" stores another row,
            so that a policy also sees arms under way.
    """
    last = episode.rows - 1
    if view == "frames":
        return list(range(last))
    starts = episode.stage_starts()
    chosen = {*starts, last}
    for start, end in zip(starts, [*starts[1:], last], strict=True):
        motion = _motion_ticks(episode, start, end)
        chosen.update(row for row in (start + round(u * motion) for u in intermediate) if row < end)
    return sorted(chosen)


def row_columns(episode: Demonstration, row: int, view: View) -> dict[str, NDArray | str]:
    """Everything but images that a view stores in a row, with the dtypes of the schema.

    Row T repeats the last keypose and state hash, as no tick follows it.
    """
    last = episode.rows - 1
    step = episode.steps[min(row, last - 1)]
    vectors = episode.final_observation if row == last else step.observation
    last_stored = last - 1 if view == "frames" else last
    is_keyframe = row == last_stored or row in episode.stage_starts()[1:]
    return {
        **vectors,
        schema.ACTION: step.action if view == "frames" else episode.keyposes[step.stage],
        schema.KEYFRAME: np.array([is_keyframe]),
        schema.TICK: np.array([row], dtype=np.int64),
        schema.TIME: np.array([row / CONTROL_HZ], dtype=np.float32),
        schema.STATE_HASH: np.array([step.state_hash], dtype=np.int64),
        schema.TASK_NAME: episode.meta.task,
        schema.SPLIT: episode.meta.split,
        schema.VARIATION: np.array([episode.meta.variation], dtype=np.int64),
        schema.SEED: np.array([episode.meta.seed], dtype=np.int64),
        **episode.further,
    }


def _motion_ticks(episode: Demonstration, start: int, end: int) -> int:
    """Ticks of a stage until its joint targets stop changing; rest and gripper events follow after."""
    steps = episode.steps
    before = steps[start - 1].action if start else steps[0].observation[schema.STATE]
    targets = np.array([before, *(step.action for step in steps[start:end])])
    joints = by_arm(targets)[..., :JOINTS_PER_ARM]
    moving = np.flatnonzero((np.diff(joints, axis=0) != 0).any(axis=(1, 2)))
    return int(moving[-1]) + 1 if len(moving) else 0
