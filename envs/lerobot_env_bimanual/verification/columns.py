"""Checks of an episode's vectors and scalars, by their own logic: no simulation, no image."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import EpisodeKey
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.geometry.rotations import quat_wxyz_to_matrix
from lerobot_bimanual.joint_action import by_arm
from lerobot_bimanual.keypose import ARM_KEYPOSE_DIM, GRIPPER_OPEN, IGNORE_COLLISIONS, POSITION, QUATERNION
from lerobot_env_bimanual.episode.actions import ActionReader
from lerobot_env_bimanual.options import SPLITS
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.verification.fault import Fault, first_of

RIGID = 1e-5
"""Largest change, m and rad, of a camera against what carries it: float32 keeps 1e-6 of it."""

UNIT = 1e-6
"""Largest difference of a quaternion's length from 1 in float32."""

REACHED = 1e-4
"""Largest distance, m and rad, between a keypose and the joint targets that end its motion."""


def check_rows(dataset: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Ticks begin at 0 and rise, one by one in the view `frames`; all numbers are finite."""
    ticks = episode.columns[schema.TICK]
    steps = np.diff(ticks, prepend=-1)
    wrong = steps != 1 if dataset.view == "frames" else steps < 1
    wrong[0] = ticks[0] != 0
    yield from first_of(wrong, "tick does not follow the row before")
    for key in schema.VECTORS:
        values = episode.columns[key].reshape(len(episode), -1)
        yield from first_of(~np.isfinite(values).all(axis=1), f"{key} is not finite")


def check_key(dataset: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Task, variation, split and seed are the same in every row, exist, and are those that the dataset lists."""
    for key in (schema.TASK_NAME, schema.VARIATION, schema.SPLIT, schema.SEED):
        column = episode.columns[key]
        yield from first_of(column != column[0], f"{key} changes within the episode")
    listed = dataset.provenance.episodes if dataset.provenance is not None else ()
    meta = episode.meta
    found = EpisodeKey(task=meta.task, variation=meta.variation, split=meta.split, seed=meta.seed)
    if episode.index < len(listed) and listed[episode.index] != found:
        yield Fault(f"holds {found}, but the dataset lists {listed[episode.index]}")
    if meta.split not in SPLITS or meta.seed < 0:
        yield Fault(f"there is no seed {meta.seed} of the split {meta.split!r}")
    spec = get_task(meta.task).spec
    spec.variation_index(meta.variation)
    sentences = spec.instructions_for(spec.variations[meta.variation])
    if meta.instruction not in sentences:
        yield Fault(
            f"is told {meta.instruction!r}, but its task says one of {', '.join(map(repr, sentences))}"
        )


def check_keyframes(_: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """`keypose_step` counts up from 0 without a gap, and `keyframe` is set where it rises and in the last row."""
    steps, flags = episode.columns[schema.KEYPOSE_STEP], episode.columns[schema.KEYFRAME]
    rises = np.diff(steps, prepend=0.0)
    yield from first_of(~np.isin(rises, (0, 1)), "keypose_step does not stay or rise by one")
    expected = rises > 0
    expected[-1] = True
    yield from first_of(flags & ~expected, "keyframe is set, but no keypose was completed")
    yield from first_of(expected & ~flags, "keyframe is not set, but a keypose was completed")


def check_actions(_: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Joint targets are within the joints' limits and grippers within 0..1, so that playing them clips nothing."""
    actions, limits = episode.columns[schema.ACTION], ActionReader("joint", PANDA_PAIR)
    outside = (actions < limits.lower) | (actions > limits.upper)
    for element in np.flatnonzero(outside.any(axis=0)):
        name, low, high = schema.JOINT_NAMES[element], limits.lower[element], limits.upper[element]
        yield from first_of(outside[:, element], f"{name} is commanded beyond {low:.4g} to {high:.4g}")


def check_forms(_: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Equal poses have equal numbers: quaternions have unit length and w >= 0, flags of keyposes are 0 or 1."""
    labels = episode.columns[schema.NEXT_KEYPOSE].reshape(len(episode), len(ARMS), ARM_KEYPOSE_DIM)
    hands = episode.columns[schema.EE_POSE].reshape(len(episode), len(ARMS), -1)
    for key, poses in ((schema.NEXT_KEYPOSE, labels), (schema.EE_POSE, hands)):
        quaternions = poses[..., QUATERNION].astype(np.float64)
        is_unit = np.abs(np.linalg.norm(quaternions, axis=-1) - 1) <= UNIT
        is_canonical = (is_unit & (quaternions[..., 0] >= 0)).all(axis=1)
        yield from first_of(~is_canonical, f"{key} has a quaternion that is not of unit length with w >= 0")
    flags = labels[..., [GRIPPER_OPEN, IGNORE_COLLISIONS]]
    yield from first_of(
        ~np.isin(flags, (0, 1)).all(axis=(1, 2)), "next_keypose has a flag that is not 0 or 1"
    )


def check_labels(dataset: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """`next_keypose` is one keypose per stage, namely the one at which the stage's motion ends.

    Where the motion ends is read from the joint targets of the stage's last tick, which the view `frames` stores. The
    last stage is left out, because success may cut it short.
    """
    labels, steps = episode.columns[schema.NEXT_KEYPOSE], episode.columns[schema.KEYPOSE_STEP].copy()
    if dataset.view == "keyframes":
        steps[-1:] = steps[-2:-1]  # the last row repeats the last label, completed
    stays = np.diff(steps, append=np.nan) == 0
    changed = np.zeros(len(episode), bool)
    changed[1:] = stays[:-1] & (labels[1:] != labels[:-1]).any(axis=1)
    yield from first_of(changed, "next_keypose changes within a stage")
    if dataset.view == "frames":
        ends = np.flatnonzero(~stays)[:-1]
        missed = np.zeros(len(episode), bool)
        missed[ends] = [_misses(episode.columns[schema.ACTION][end], labels[end]) for end in ends]
        yield from first_of(missed, "next_keypose is not where the stage's motion ends")


def check_calibration(_: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Each wrist camera is fixed to its hand and every other one to the world; lenses do not change."""
    extrinsics = (
        episode.columns[schema.CAMERA_EXTRINSICS].astype(np.float64).reshape(-1, len(CAMERA_NAMES), 4, 4)
    )
    hands = _hand_poses(episode)
    for index, camera in enumerate(CAMERA_NAMES):
        arm = next((arm for arm in ARMS if camera == f"{arm}_wrist"), None)
        poses = extrinsics[:, index]
        carrier = "the world"
        if arm is not None:
            poses = np.linalg.inv(hands[:, arm.ordinal]) @ poses
            carrier = f"the {arm} hand"
        moved = np.abs(poses - np.median(poses, axis=0)).max(axis=(1, 2)) > RIGID
        yield from first_of(moved, f"camera {camera} is not fixed to {carrier}")
    intrinsics = episode.columns[schema.CAMERA_INTRINSICS]
    yield from first_of((intrinsics != intrinsics[0]).any(axis=1), "intrinsics change within the episode")


COLUMN_CHECKS: dict[str, Callable[[RecordedDataset, RecordedEpisode], Iterator[Fault]]] = {
    "rows": check_rows,
    "episode key": check_key,
    "keyframes": check_keyframes,
    "actions": check_actions,
    "forms": check_forms,
    "labels": check_labels,
    "calibration": check_calibration,
}


def _hand_poses(episode: RecordedEpisode) -> NDArray[np.float64]:
    """World poses (rows, 2, 4, 4) of the tool centre points."""
    vectors = episode.columns[schema.EE_POSE].astype(np.float64).reshape(-1, len(ARMS), 7)
    poses = np.zeros((*vectors.shape[:2], 4, 4))
    poses[..., :3, :3] = quat_wxyz_to_matrix(vectors[..., 3:])
    poses[..., :3, 3] = vectors[..., :3]
    poses[..., 3, 3] = 1
    return poses


def _misses(action: NDArray[np.float32], keypose: NDArray[np.float32]) -> bool:
    """Whether joint targets (16,) put a hand elsewhere than a keypose (18,), or leave a gripper otherwise."""
    targets = by_arm(action.astype(np.float64))
    for arm, target, goal in zip(
        ARMS, targets, keypose.astype(np.float64).reshape(-1, ARM_KEYPOSE_DIM), strict=True
    ):
        hand = PANDA_PAIR.kinematics[arm].fk(target[:JOINTS_PER_ARM])
        turned = np.abs(hand[:3, :3] - quat_wxyz_to_matrix(goal[QUATERNION])).max()
        moved = np.abs(hand[:3, 3] - goal[POSITION]).max()
        if max(moved, turned) > REACHED or (target[JOINTS_PER_ARM] > 0.5) != (goal[GRIPPER_OPEN] > 0.5):
            return True
    return False
