"""How far predictions are from the labels, over a whole dataset and keypose by keypose."""

from collections.abc import Callable

import pandas as pd
import torch
from lerobot.datasets import LeRobotDataset
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset.schema import ACTION, KEYPOSE_STEP
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, GRIPPER_OPEN, IGNORE_COLLISIONS
from lerobot_policy_bimanual.inspection.loading import Batch, batch_of
from lerobot_policy_bimanual.keypose.losses import distances
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

BATCH_SIZE = 16


def measure(
    policy: KeyposePolicy, preprocess: Callable[[Batch], Batch], dataset: LeRobotDataset
) -> pd.DataFrame:
    """Predict every row of a dataset and compare with its label.

    Returns:
        One line per row and arm: `after`, the keyposes completed when the row was seen, `arm`, `cm` and `deg`, the
        distance and the angle between the predicted and the true hand, and whether the `gripper` and the collision `flag`
        are wrong.
    """
    parts = []
    starts = range(0, len(dataset), BATCH_SIZE)
    for start in tqdm(starts, desc="predicting", unit="batch"):
        batch = preprocess(batch_of(dataset, range(start, min(start + BATCH_SIZE, len(dataset)))))
        predicted, label = policy.select_action(batch), batch[ACTION]
        distance_m, angle_rad = distances(predicted, label)
        flags = [vector.unflatten(-1, (len(ARMS), ARM_KEYPOSE_DIM)) > 0.5 for vector in (predicted, label)]
        wrong = flags[0] != flags[1]
        columns = {
            "cm": 100 * distance_m,
            "deg": torch.rad2deg(angle_rad),
            "gripper": wrong[..., GRIPPER_OPEN],
            "flag": wrong[..., IGNORE_COLLISIONS],
        }
        after = batch[KEYPOSE_STEP].flatten().long()
        for arm in ARMS:
            of_arm = {name: values[:, arm.ordinal].cpu() for name, values in columns.items()}
            parts.append(pd.DataFrame({"after": after.cpu(), "arm": str(arm)} | of_arm))
    return pd.concat(parts).sort_values(["after", "arm"], kind="stable", ignore_index=True)


def summary(errors: pd.DataFrame) -> pd.DataFrame:
    """One line per keypose and arm, and one for everything: distances in cm, mean angle in degrees, shares of wrong flags."""
    errors = errors.astype({"cm": float, "deg": float})  # of float32 the rounded ones have 16 digits
    everything = errors.assign(after="all", arm="both")
    return (
        pd.concat([errors.astype({"after": str}), everything])
        .groupby(["after", "arm"], sort=False)
        .agg(
            rows=("cm", "size"),
            cm=("cm", "mean"),
            median=("cm", "median"),
            p90=("cm", lambda values: values.quantile(0.9)),
            worst=("cm", "max"),
            deg=("deg", "mean"),
            gripper=("gripper", "mean"),
            flag=("flag", "mean"),
        )
        .reset_index()
        .round({"cm": 2, "median": 2, "p90": 2, "worst": 2, "deg": 1, "gripper": 3, "flag": 3})
    )
