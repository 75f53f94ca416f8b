"""How far predictions are from the labels, over a whole dataset and keypose by keypose."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from lerobot.datasets import LeRobotDataset
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset.schema import KEYPOSE_STEP, NEXT_KEYPOSE
from lerobot_bimanual.keypose import ARM_KEYPOSE_DIM, GRIPPER_OPEN, IGNORE_COLLISIONS
from lerobot_bimanual.tables import print_table
from lerobot_policy_bimanual.inspection.loading import Batch, batch_of
from lerobot_policy_bimanual.keypose.losses import distances
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

ROWS_AT_ONCE = 16


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Errors of every row of a dataset; arms on the last axis, left before right.

    Attributes:
        keypose_step: (n,) keyposes completed when the row was seen.
        position_cm: (n, arms) distance of the predicted hand from the true one.
        rotation_deg: (n, arms) angle between them.
        gripper_wrong: (n, arms) whether the gripper was to do something else.
        collisions_wrong: (n, arms) likewise the collision flag.
    """

    keypose_step: NDArray[np.int64]
    position_cm: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]
    gripper_wrong: NDArray[np.bool_]
    collisions_wrong: NDArray[np.bool_]

    def print(self, title: str) -> None:
        """One line per keypose and arm, and one for everything.

        Mean, median, 90 % quantile and maximum of the distances in centimetres, mean angle in degrees, and the shares
        of wrong grippers and collision flags.
        """
        headings = ("after", "arm", "rows", "cm", "median", "90 %", "worst", "deg", "gripper", "flag")
        rows = [
            (str(step), str(arm), *self._cells(self.keypose_step == step, arm))
            for step in np.unique(self.keypose_step)
            for arm in ARMS
        ]
        rows.append(("all", "both", *self._cells(np.ones(len(self.keypose_step), bool), None)))
        print_table(headings, rows, title)

    def _cells(self, rows: NDArray[np.bool_], arm: Arm | None) -> Iterator[str]:
        arms = slice(None) if arm is None else arm.ordinal
        position_cm = self.position_cm[rows][:, arms]
        yield str(int(rows.sum()))
        for value in (position_cm.mean(), *np.quantile(position_cm, (0.5, 0.9, 1.0))):
            yield f"{value:.2f}"
        yield f"{self.rotation_deg[rows][:, arms].mean():.1f}"
        for wrong in (self.gripper_wrong, self.collisions_wrong):
            yield f"{wrong[rows][:, arms].mean():.1%}"


def measure(policy: KeyposePolicy, preprocess: Callable[[Batch], Batch], dataset: LeRobotDataset) -> Accuracy:
    """Predict every row of a dataset and compare with its label."""
    parts = []
    starts = range(0, len(dataset), ROWS_AT_ONCE)
    for start in tqdm(starts, desc="predicting", unit_scale=ROWS_AT_ONCE, unit="row"):
        rows = range(start, min(start + ROWS_AT_ONCE, len(dataset)))
        batch = preprocess(batch_of(dataset, rows))
        predicted, label = policy.select_action(batch), batch[NEXT_KEYPOSE]
        distance_m, angle_rad = distances(predicted, label)
        flags = [vector.unflatten(-1, (len(ARMS), ARM_KEYPOSE_DIM)) > 0.5 for vector in (predicted, label)]
        wrong = flags[0] != flags[1]
        parts.append(
            [
                batch[KEYPOSE_STEP].flatten().long(),
                100 * distance_m,
                torch.rad2deg(angle_rad),
                wrong[..., GRIPPER_OPEN],
                wrong[..., IGNORE_COLLISIONS],
            ]
        )
    return Accuracy(*(torch.cat(values).cpu().numpy() for values in zip(*parts, strict=True)))
