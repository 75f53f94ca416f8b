"""Print how far the hands that a policy of joint actions predicts are from the expert's at each keypose.

From the frame TICKS before each keypose of each demonstration the policy predicts a chunk; action number TICKS of it is
compared with the one by which the expert reached the keypose. Demonstrations that the policy was not trained on show what it
cannot predict yet.
Usage: chunk_errors.py --checkpoint=outputs/act/checkpoints/last/pretrained_model --root=data/val [--ticks=20]
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from lerobot.datasets import LeRobotDataset
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.collate import lerobot_collate_fn
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.dataset.schema import ACTION, KEYFRAME
from lerobot_env_bimanual.robots.panda_pair import ArmPair
from lerobot_policy_bimanual.checkpoint.check import check_checkpoint

Predict = Callable[[LeRobotDataset, int], NDArray[np.float64]]
"""Of a dataset and a row: the chunk (n, 16) of joint actions that a policy predicts there."""


def main() -> None:
    """Print the table of one policy and one dataset."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--checkpoint", type=Path, required=True, help="folder pretrained_model")
    parser.add_argument("--root", type=Path, required=True, help="dataset of one task, view `frames`")
    parser.add_argument("--ticks", type=int, default=20, help="from the prediction to the keypose, of 50 ms")
    options = parser.parse_args()
    dataset = LeRobotDataset(f"local/{options.root.name}", root=options.root, video_backend="pyav")
    errors = pd.DataFrame(measure(policy(options.checkpoint), dataset, options.ticks))
    print(errors.groupby(["keypose", "arm"]).cm.describe(percentiles=[0.5, 0.9]).round(1).to_string())


def policy(checkpoint: Path) -> Predict:
    """A function that predicts chunks with a policy that LeRobot can load."""
    config = check_checkpoint(checkpoint).config
    network = get_policy_class(config.type).from_pretrained(checkpoint, config=config).eval()
    preprocess, postprocess = make_pre_post_processors(config, pretrained_path=str(checkpoint))

    @torch.no_grad()
    def predict(dataset: LeRobotDataset, row: int) -> NDArray[np.float64]:
        rows: list[Any] = [dataset[row]]
        batch: Any = lerobot_collate_fn(rows)
        del batch[ACTION]
        return postprocess(network.predict_action_chunk(preprocess(batch)))[0].double().numpy()

    return predict


def measure(predict: Predict, dataset: LeRobotDataset, ticks: int) -> Iterator[dict[str, Any]]:
    """The distance in cm for each demonstration, keypose (from 1) and arm; keyposes before tick TICKS are left out."""
    columns = dataset.hf_dataset.with_format("numpy")[:]
    episodes, actions = columns["episode_index"], np.stack(columns[ACTION]).astype(np.float64)
    kinematics = ArmPair().kinematics
    for reached in tqdm(np.flatnonzero(columns[KEYFRAME]), desc="predicting", unit="keypose"):
        first, start = np.searchsorted(episodes, episodes[reached]), reached - ticks
        if start < first:
            continue
        chunk = predict(dataset, int(start))
        if not 1 <= ticks <= len(chunk):
            raise SystemExit(f"--ticks is {ticks}, but must be from 1 to {len(chunk)}, the policy's chunk")
        keypose = int(np.count_nonzero(columns[KEYFRAME][first + 1 : reached + 1]))
        both = np.stack([chunk[ticks - 1], actions[reached - 1]]).reshape(2, len(ARMS), -1)
        for arm in ARMS:
            found, true = (kinematics[arm].pose(joints) for joints in both[:, arm.ordinal, :JOINTS_PER_ARM])
            yield {"keypose": keypose, "arm": str(arm), "cm": 100 * found.distance_to(true)[0]}


if __name__ == "__main__":
    main()
