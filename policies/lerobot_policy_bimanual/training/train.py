"""`lerobot-bimanual-train`: LeRobot's own training on a dataset that is held in memory.

`lerobot-train` decodes every image again at every step, in loader processes that each take a core of a laptop and
cannot keep up with a GPU. This program takes the same flags and calls the same function, but decodes the dataset once,
before the first step, into the memory of the policy's device. Loaders then give row numbers, and rows are looked up on
the device. Logs, checkpoints and how to resume are LeRobot's.
"""

import logging
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from lerobot.configs.train import TrainPipelineConfig
from lerobot.configs.video import DEPTH_MILLIMETER_UNIT
from lerobot.scripts import lerobot_train

import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies: the package came before LeRobot
from lerobot_bimanual.dataset.reader import INFO_FILE, views_below
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

ROW_KEYS = ("row", "held_out_row")
"""Keys of a row number: of the training set, and of the one that `--dataset.eval_split` holds out."""


def main() -> int:
    """Run `lerobot-train` with the flags of this process."""
    datasets: list[ResidentDataset] = []

    def make_datasets(cfg: TrainPipelineConfig) -> tuple[ResidentDataset | None, ...]:
        made = make_resident_datasets(cfg)
        datasets.extend(dataset for dataset in made if dataset is not None)
        return made

    def make_processors(*args: Any, **kwargs: Any) -> tuple[Any, Any]:
        preprocessor, postprocessor = _make_processors(*args, **kwargs)
        to_transition = preprocessor.to_transition

        def look_up(batch: dict[str, Any]) -> Any:
            for dataset in datasets:
                if dataset.row_key in batch:  # observations of an environment have none
                    batch = dataset.batch(batch)
            return to_transition(batch)

        preprocessor.to_transition = look_up
        return preprocessor, postprocessor

    lerobot_train.make_train_eval_datasets = make_datasets
    lerobot_train.make_pre_post_processors = make_processors
    lerobot_train.compute_sampler_state = take_back_a_draw
    try:
        lerobot_train.main()
    except BimanualError as error:
        print(f"lerobot-bimanual-train: {error}", file=sys.stderr)
        return 1
    return 0


def make_resident_datasets(cfg: TrainPipelineConfig) -> tuple[ResidentDataset | None, ...]:
    """The datasets that `lerobot-train` would make, in memory.

    Raises:
        DatasetError: there are none, they are streamed, are transformed at random, are asked for in metres, do not fit
            into memory, or are for a reward model.
    """
    if cfg.is_reward_model_training:
        raise DatasetError("only policies are trained from memory; use `lerobot-train` for a reward model")
    if cfg.dataset.streaming or cfg.dataset.image_transforms.enable:
        raise DatasetError(
            "rows that are decoded once can be neither streamed nor transformed at random: leave out "
            "--dataset.streaming and --dataset.image_transforms.enable, or use `lerobot-train`"
        )
    if cfg.dataset.depth_output_unit != DEPTH_MILLIMETER_UNIT:
        raise DatasetError(
            f"depth is kept in memory in whole millimetres, and cannot be given in {cfg.dataset.depth_output_unit!r}: "
            "leave out --dataset.depth_output_unit, or use `lerobot-train`"
        )
    if cfg.num_workers:
        logging.info("No loader processes: the dataset is in memory")
        cfg.num_workers = 0
    # The number of a GPU is left out, because LeRobot trains on the first one that it sees.
    device = torch.device(str(getattr(cfg.trainable_config, "device", None) or "cpu").partition(":")[0])
    datasets: tuple[Any, ...] = load_datasets(cfg, _make_datasets)
    images = images_read(cfg, datasets[0].meta)
    return tuple(
        None if dataset is None else ResidentDataset(dataset, device, row_key, images)
        for dataset, row_key in zip(datasets, ROW_KEYS, strict=True)
    )


def load_datasets[T](cfg: TrainPipelineConfig, load: Callable[[TrainPipelineConfig], T]) -> T:
    """Load the datasets of a training, as LeRobot does.

    Args:
        cfg: of the training.
        load: LeRobot's function. Where there is no dataset, it looks for one on the Hub.

    Raises:
        DatasetError: the folder is the one above the views, or there is no dataset, neither here nor on the Hub.
    """
    root, repo_id = cfg.dataset.root, cfg.dataset.repo_id
    if root is None or (Path(root) / INFO_FILE).is_file():
        return load(cfg)
    if views := views_below(Path(root)):
        raise DatasetError(
            f"--dataset.root={root} holds the views of a dataset, but must be one of them: give "
            f"{' or '.join(f'--dataset.root={view}' for view in views)}. Keypose policies learn from `keyframes`, "
            "policies of joint actions from `frames`"
        )
    try:
        return load(cfg)
    except Exception as error:  # whatever keeps it from the Hub: a name, the network, rights
        raise DatasetError(
            f"--dataset.root={root} is no dataset ({Path(root) / INFO_FILE} does not exist), and {repo_id} could not "
            f"be downloaded to it: {' '.join(str(error).split())}"
        ) from error


def images_read(cfg: TrainPipelineConfig, meta: Any) -> set[str]:
    """Keys of the images that the policy reads: those among the inputs that it names, or all if it names none.

    Args:
        cfg: of the training.
        meta: LeRobot's metadata of the dataset.
    """
    named = cfg.policy.input_features if cfg.policy is not None else None
    return {key for key in meta.camera_keys if not named or cfg.rename_map.get(key, key) in named}


def take_back_a_draw(*args: Any, **kwargs: Any) -> dict[str, int]:
    """Return where in the data a training is resumed, as LeRobot computes it, and keep the random numbers in step.

    A loader draws a number whenever it starts. A training that is resumed within an epoch starts it once more than the
    uninterrupted one did, after LeRobot has restored the random state; that draw is taken back.
    """
    state = _compute_sampler_state(*args, **kwargs)
    if state["start_index"]:
        lerobot_train.cycle = _cycle_without_first_draw
    return state


def _cycle_without_first_draw(loader: Any) -> Iterator[Any]:
    batches = _cycle(loader)
    with torch.random.fork_rng(devices=()):
        first = next(batches)
    yield first
    yield from batches


_compute_sampler_state = lerobot_train.compute_sampler_state
_cycle = lerobot_train.cycle
_make_datasets = lerobot_train.make_train_eval_datasets
_make_processors = lerobot_train.make_pre_post_processors

if __name__ == "__main__":
    sys.exit(main())
