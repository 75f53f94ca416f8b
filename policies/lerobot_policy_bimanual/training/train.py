"""`lerobot-bimanual-train`: LeRobot's own training on a dataset that is held in memory.

`lerobot-train` decodes every image again at every step, in loader processes that each take a core of a laptop and
cannot keep up with a GPU. This program takes the same flags and calls the same function; it only decodes the dataset
once, before the first step, and then needs no loaders. Logs, checkpoints and how to resume are LeRobot's.
"""

import logging
import sys
from typing import Any

from lerobot.configs.train import TrainPipelineConfig
from lerobot.scripts import lerobot_train

import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies: the package came before LeRobot
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset


def main() -> int:
    """Run `lerobot-train` with the flags of this process."""
    lerobot_train.make_train_eval_datasets = make_resident_datasets
    try:
        lerobot_train.main()
    except BimanualError as error:
        print(f"lerobot-bimanual-train: {error}", file=sys.stderr)
        return 1
    return 0


def make_resident_datasets(cfg: TrainPipelineConfig) -> tuple[ResidentDataset | None, ...]:
    """The datasets that `lerobot-train` would make, in memory.

    Raises:
        DatasetError: They are streamed, are transformed at random, or do not fit into memory.
    """
    if cfg.dataset.streaming or cfg.dataset.image_transforms.enable:
        raise DatasetError(
            "rows that are decoded once can be neither streamed nor transformed at random: leave out "
            "--dataset.streaming and --dataset.image_transforms.enable, or use `lerobot-train`"
        )
    if cfg.num_workers:
        logging.info("No loader processes: the dataset is in memory")
        cfg.num_workers = 0
    datasets: tuple[Any, ...] = _make_datasets(cfg)
    return tuple(None if dataset is None else ResidentDataset(dataset) for dataset in datasets)


_make_datasets = lerobot_train.make_train_eval_datasets

if __name__ == "__main__":
    sys.exit(main())
