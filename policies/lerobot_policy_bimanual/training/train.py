"""`lerobot-bimanual-train`: LeRobot's own training on a dataset that is held in memory.

`lerobot-train` decodes every image again at every step, in loader processes that each take a core of a laptop and
cannot keep up with a GPU. This program takes the same flags and calls the same function, but decodes the dataset once,
before the first step, into the memory of the policy's device. Loaders then give row numbers, and rows are looked up on
the device. Logs, checkpoints and how to resume are LeRobot's.

LeRobot passes its loaders to an accelerator that it gets from its caller: version 0.6.1 as an argument of its function,
later versions from `cfg.accelerator.build`. Ours returns loaders of the same rows from memory instead.
"""

import inspect
import logging
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import torch
from accelerate import Accelerator
from accelerate.utils import DistributedDataParallelKwargs
from lerobot.configs import parser
from lerobot.configs.train import TrainPipelineConfig
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.configs.video import DEPTH_MILLIMETER_UNIT
from lerobot.datasets import EpisodeAwareSampler
from lerobot.scripts import lerobot_train
from torch.utils.data import DataLoader, Subset

import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies: the package came before LeRobot
from lerobot_bimanual.checkpoint_folder import how_to_resume
from lerobot_bimanual.cli.lerobot_flags import is_trusted
from lerobot_bimanual.dataset.reader import is_depth, read_info
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import check_output_folder, share_files
from lerobot_policy_bimanual.checkpoint.check import check_checkpoint
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.training.dataset_folder import check_dataset
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

logger = logging.getLogger(__name__)  # the root's functions would add a handler of everything


class LoaderFromMemory:
    """Batches of a dataset in memory, of the rows whose numbers a loader gives.

    Args:
        numbers: gives batches of items of a `ResidentDataset`, or of a part of one.
        is_resumed: whether the training goes on within an epoch. A loader draws a random number whenever it starts, and
            here starts once more than in the uninterrupted training, after LeRobot has restored the random state; that
            draw is taken back.
    """

    def __init__(self, numbers: DataLoader, is_resumed: bool):
        self._numbers, self._is_resumed = numbers, is_resumed
        self._dataset: ResidentDataset = _unwrap_subset(numbers.dataset)

    def __len__(self) -> int:
        """Batches of an epoch."""
        return len(self._numbers)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the batches of an epoch."""
        batches = iter(self._numbers)
        with torch.random.fork_rng(devices=(), enabled=self._is_resumed):
            first = next(batches)
        self._is_resumed = False
        yield self._dataset.batch(first)
        yield from map(self._dataset.batch, batches)


class AcceleratorWithMemory:
    """An accelerator whose loaders give rows from memory; all else is the wrapped accelerator's.

    Args:
        cfg: of the training.
        make: makes the accelerator, when LeRobot first uses it: after it has validated the config.
        keep_last: how many checkpoints are kept; None keeps all.
    """

    def __init__(self, cfg: TrainPipelineConfig, make: Callable[[], Accelerator], keep_last: int | None):
        self._cfg, self._make, self._keep_last = cfg, make, keep_last
        self._made: Accelerator | None = None
        self._is_prepared = False  # a checkpoint that is resumed has been read then

    def _accelerator(self) -> Accelerator:
        if self._made is None:
            # LeRobot first uses it just before it adds its own log handler. A library's message here adds
            # another one, which is removed again.
            root = logging.getLogger()
            handlers = [*root.handlers]
            check_training(self._cfg)
            self._made = self._make()
            root.handlers = handlers
        return self._made

    def __getattr__(self, name: str) -> Any:
        """Get an attribute of the accelerator."""
        return getattr(self._accelerator(), name)

    def prepare(self, *parts: Any) -> tuple[Any, ...]:
        """Prepare what a training consists of: the policy, its optimizer and scheduler, and loaders.

        Raises:
            DatasetError: the rows of a loader do not fit into memory.
        """
        numbers = [self._row_number_loader(part) if isinstance(part, DataLoader) else part for part in parts]
        prepared = self._accelerator().prepare(*numbers)
        self._is_prepared = True
        return tuple(
            _from_memory(part, new) if isinstance(part, DataLoader) else new
            for part, new in zip(parts, prepared, strict=True)
        )

    def wait_for_everyone(self) -> None:
        """Wait for all processes, as after a checkpoint; then let others read it as the umask allows, and remove older ones."""
        self._accelerator().wait_for_everyone()
        if self._accelerator().is_main_process and self._cfg.output_dir is not None:
            share_files(Path(self._cfg.output_dir), "*.safetensors")  # written for their owner alone
            if self._keep_last and self._is_prepared:
                remove_older(Path(self._cfg.output_dir, "checkpoints"), self._keep_last)

    def _row_number_loader(self, loader: DataLoader) -> DataLoader:
        """A loader of the numbers of the same rows, whose dataset is in memory."""
        rows, dataset = loader.dataset, _unwrap_subset(loader.dataset)
        images = input_image_keys(self._cfg, dataset.meta)
        held = ResidentDataset(dataset, self._accelerator().device, images, self._cfg.dataset.video_backend)
        return DataLoader(
            Subset(held, rows.indices) if isinstance(rows, Subset) else held,
            loader.batch_size,
            sampler=loader.sampler,
            collate_fn=loader.collate_fn,
            pin_memory=loader.pin_memory,
        )


def _unwrap_subset(rows: Any) -> Any:
    return rows.dataset if isinstance(rows, Subset) else rows


def remove_older(checkpoints: Path, keep_last: int) -> None:
    """Remove all but the newest checkpoints up to `last`; later ones, of another run or cut off, and other folders stay."""
    last = checkpoints / "last"
    if last.exists():
        steps = {int(folder.name): folder for folder in checkpoints.iterdir() if folder.name.isdecimal()}
        for step in sorted(step for step in steps if step <= int(last.resolve().name))[:-keep_last]:
            shutil.rmtree(steps[step])


def _from_memory(loader: DataLoader, prepared: Any) -> LoaderFromMemory:
    """Batches from memory for a prepared loader of row numbers; they start where the sampler of `loader` continues."""
    state = loader.sampler.state_dict() if isinstance(loader.sampler, EpisodeAwareSampler) else {}
    if state:
        prepared.iteration = state["epoch"]  # accelerate would set the sampler back to epoch 0
    return LoaderFromMemory(prepared, bool(state.get("start_index")))


@parser.wrap()
def train(cfg: TrainPipelineConfig, keep_last: int | None = None) -> None:
    """Train with the dataset in memory.

    Args:
        cfg: of the training.
        keep_last: how many checkpoints are kept, the newest ones; None keeps all.

    Raises:
        DatasetError: as in `check_training`, or the dataset does not fit into memory.
        BadConfig: the training is to run elsewhere.
        KeyboardInterrupt: it was interrupted; the text says how it goes on.
    """
    if cfg.job.is_remote:
        raise BadConfig("--job.target names another machine: submit the training with `lerobot-train`")
    try:
        _train(cfg, keep_last)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(how_to_resume(Path(cfg.output_dir or ""))) from None


def _train(cfg: TrainPipelineConfig, keep_last: int | None) -> None:
    if "accelerator" in inspect.signature(lerobot_train.train).parameters:
        accelerator: Any = AcceleratorWithMemory(cfg, partial(_accelerator_of_0_6_1, cfg), keep_last)
        lerobot_train.train(cfg, accelerator)
        return
    later: Any = cfg  # of a LeRobot after 0.6

    class WithMemory(type(later.accelerator)):
        """LeRobot's config of an accelerator, which makes ours."""

        def build(self, *args: Any, **kwargs: Any) -> Any:
            return AcceleratorWithMemory(cfg, partial(super().build, *args, **kwargs), keep_last)

    later.accelerator = WithMemory(**vars(later.accelerator))
    lerobot_train.train(later)


def _accelerator_of_0_6_1(cfg: TrainPipelineConfig) -> Accelerator:
    """The accelerator that LeRobot 0.6.1 makes itself where it is given none."""
    config: Any = cfg.trainable_config
    dtype = getattr(config, "dtype", None)
    if not hasattr(config, "dtype") and getattr(config, "use_amp", False):
        dtype = str(torch.get_autocast_dtype(torch.device(config.device).type)).removeprefix("torch.")
    return Accelerator(
        step_scheduler_with_optimizer=False,
        mixed_precision={"bfloat16": "bf16", "float16": "fp16", "float32": "no"}.get(str(dtype)),
        kwargs_handlers=[DistributedDataParallelKwargs(find_unused_parameters=True)],
        cpu=config.device == "cpu",
    )


def check_training(cfg: TrainPipelineConfig) -> None:
    """Check that a training can have its dataset in memory, and set its config to no loader processes.

    Raises:
        DatasetError: the dataset is streamed, transformed at random, read in metres, for a reward model, has depth for a
            policy of LeRobot, or as in `check_dataset`.
        UnwritableOutput: nothing can be written to the folder of the training.
        CheckpointError: the checkpoint that it starts from does not pass `check_checkpoint`, and no flag says to trust it.
    """
    path = getattr(cfg.policy, "pretrained_path", None)
    if path is not None and not is_trusted(sys.orig_argv):
        check_checkpoint(Path(path))
    if cfg.is_reward_model_training:
        raise DatasetError("only policies are trained from memory; use `lerobot-train` for a reward model")
    if cfg.dataset.streaming:
        raise DatasetError(
            "rows that are decoded once cannot be streamed: leave out --dataset.streaming, or use `lerobot-train`"
        )
    if cfg.dataset.image_transforms.enable:
        raise DatasetError(
            "images that are decoded once cannot be transformed at random: leave out --dataset.image_transforms.enable. "
            "`lerobot-train` takes it, but its transform `affine` moves colours beside their depth: for a keypose policy "
            "give --dataset.image_transforms.tfs without it"
        )
    if cfg.dataset.depth_output_unit != DEPTH_MILLIMETER_UNIT:
        raise DatasetError(
            f"depth is kept in memory in whole millimetres, and cannot be given in {cfg.dataset.depth_output_unit!r}: "
            "leave out --dataset.depth_output_unit, or use `lerobot-train`"
        )
    if cfg.dataset.root is not None:
        root = Path(cfg.dataset.root)
        check_dataset(root, cfg.dataset.episodes or [0])
        stored = read_info(root)["features"]
        has_depth = any(map(is_depth, stored.values()))
        policy = cfg.policy
        is_of_lerobot = type(policy).__module__.startswith("lerobot.policies.")
        if policy and is_of_lerobot and not policy.input_features and has_depth:
            raise DatasetError(
                f"the policy {policy.type!r} would take the depth in {root} for colours: generate the dataset with "
                "--depth=false, or name what it reads by --policy.input_features"
            )
        if policy and is_of_lerobot and path is None:
            _check_image_sizes(root, stored, policy.input_features or {})
    if cfg.output_dir is not None:
        check_output_folder(cfg.output_dir if cfg.output_dir.is_dir() else cfg.output_dir.parent)
    if cfg.num_workers:
        logger.info("No loader processes: the dataset is in memory")
        cfg.num_workers = 0


def _check_image_sizes(root: Path, stored: Mapping[str, Any], named: Mapping[str, PolicyFeature]) -> None:
    """Refuse images of other sizes than a config names, which LeRobot would write into the checkpoint."""
    for key in stored.keys() & named.keys():
        found, wanted = stored[key]["shape"][:2], named[key].shape[1:]
        if named[key].type is FeatureType.VISUAL and [*found] != [*wanted]:
            raise DatasetError(
                f"{key} in {root} is {'x'.join(map(str, found))}, but {'x'.join(map(str, wanted))} in the policy's "
                "input_features: generate the dataset with that --image_size, or set --policy.input_features"
            )


def input_image_keys(cfg: TrainPipelineConfig, meta: Any) -> set[str]:
    """Keys of a dataset's images that the policy reads: those among the inputs that it names, or all if it names none."""
    named = cfg.policy.input_features if cfg.policy is not None else None
    return {key for key in meta.camera_keys if not named or cfg.rename_map.get(key, key) in named}
