"""How far a policy of joint actions is from the expert along its chunk, and whether it looks at its images.

Prints in centimetres how far the hands that it commands are from those that the expert commanded, so many ticks after what
it saw, in the first row of every episode and in all rows. Beside it stands the same with the images of another episode,
without which it has nothing to know the placement from: a policy that is no worse then is blind. Hands that are commanded
to stay where they are are `still`.

Usage: chunk_errors.py --checkpoint=FOLDER --dataset=FOLDER [--ticks=0,9,19]
"""

import argparse
from pathlib import Path

import numpy as np
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from numpy.typing import NDArray
from torch import Tensor

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.dataset.schema import ACTION, FPS, STATE
from lerobot_bimanual.joint_action import by_arm
from lerobot_bimanual.terminal_table import print_table
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

ROWS_AT_ONCE = 32


def main() -> None:
    """Measure the checkpoint named on the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--checkpoint", type=Path, required=True, help="folder pretrained_model")
    parser.add_argument("--dataset", type=Path, required=True, help="view frames, not trained on")
    parser.add_argument("--ticks", default="0,9,19", help="after what was seen, comma separated")
    options = parser.parse_args()
    ticks = [int(tick) for tick in options.ticks.split(",")]
    first, errors_cm = measure(options.checkpoint, options.dataset, ticks)
    rows = [
        (rows, hands, *(f"{error:.1f}" for error in np.nanmean(errors[chosen], axis=0)), str(chosen.sum()))
        for rows, chosen in (("first", first), ("all", np.ones_like(first)))
        for hands, errors in errors_cm.items()
    ]
    print_table(("rows", "hands", *(f"{tick} ticks" for tick in ticks), "n"), rows, str(options.checkpoint))


def measure(
    checkpoint: Path, folder: Path, ticks: list[int]
) -> tuple[NDArray[np.bool_], dict[str, NDArray[np.float64]]]:
    """Predict every row of a dataset.

    Returns:
        Whether a row is the first of its episode (rows,), and by who commands the hands the mean distance of both from
        the expert's (rows, ticks) in centimetres, NaN beyond the episode's end.
    """
    config = PreTrainedConfig.from_pretrained(checkpoint)
    policy = get_policy_class(config.type).from_pretrained(checkpoint, config=config).eval()
    before, after = make_pre_post_processors(config, pretrained_path=str(checkpoint))
    seconds = {ACTION: [tick / FPS for tick in ticks]}
    stored = LeRobotDataset(f"local/{folder.name}", root=folder, delta_timestamps=seconds, return_uint8=True)
    images = {key for key in config.input_features or {} if key in stored.meta.camera_keys}
    dataset = ResidentDataset(stored, torch.device("cpu"), images=images)
    count = len(dataset)

    def commanded(batch: dict[str, Tensor]) -> NDArray[np.float64]:
        return hands_m(after(policy.predict_action_chunk(before(dict(batch)))[:, ticks]))

    errors: dict[str, list[NDArray[np.float64]]] = {"policy": [], "policy, other images": [], "still": []}
    for rows in torch.arange(count).split(ROWS_AT_ONCE):
        batch = dataset.batch({"row": rows})
        expert_m = np.where(batch[f"{ACTION}_is_pad"][..., None, None], np.nan, hands_m(batch[ACTION]))
        other = dataset.batch({"row": elsewhere(dataset, rows)})
        hands = (
            commanded(batch),
            commanded(batch | {key: other[key] for key in images}),
            hands_m(batch[STATE][:, None]),
        )
        for name, found_m in zip(errors, hands, strict=True):
            errors[name].append(100 * np.linalg.norm(found_m - expert_m, axis=-1).mean(axis=-1))
    first = np.diff(dataset.hf_dataset.data.column("episode_index").to_numpy(), prepend=-1) > 0
    return first, {name: np.concatenate(parts) for name, parts in errors.items()}


def elsewhere(dataset: ResidentDataset, rows: Tensor) -> Tensor:
    """Rows (n,) of the next episode, as long after its start or at its end; after the last episode comes the first."""
    episode = torch.from_numpy(dataset.hf_dataset.data.column("episode_index").to_numpy().copy())
    starts = torch.cat([torch.zeros(1, dtype=torch.long), 1 + torch.nonzero(episode.diff())[:, 0]])
    ends = torch.cat([starts[1:], torch.tensor([len(episode)])])
    here = torch.searchsorted(starts, rows, right=True) - 1
    there = (here + 1) % len(starts)
    return torch.minimum(starts[there] + rows - starts[here], ends[there] - 1)


def hands_m(joints: Tensor) -> NDArray[np.float64]:
    """Positions (n, ticks, arms, 3) in the world of joint actions (n, ticks, 16)."""
    arms = by_arm(joints.double().numpy())[..., :JOINTS_PER_ARM]
    return np.stack(
        [
            [[PANDA_PAIR.kinematics[arm].fk(tick[arm.ordinal])[:3, 3] for arm in ARMS] for tick in row]
            for row in arms
        ]
    )


if __name__ == "__main__":
    main()
