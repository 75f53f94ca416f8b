"""The program `lerobot-bimanual-train`, with what needs no LeRobot: importing LeRobot takes up to half a minute."""

import ctypes
from collections.abc import Mapping
from pathlib import Path

from lerobot_bimanual.checkpoint_folder import TRAIN_CONFIG_FILE, how_to_resume
from lerobot_bimanual.cli.flags import BadCommandLine
from lerobot_bimanual.cli.lerobot_flags import KEEP_FLAG
from lerobot_bimanual.cli.lerobot_program import run_program
from lerobot_bimanual.errors import BimanualError, plain

NO = ("false", "no", "off")
"""How LeRobot's flags say no."""

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's `mallopt`."""

MAX_KEPT_BYTES = 2**30
"""Bytes. Larger pieces go back to the system at once; a training step on a CPU allocates maps of 10 to 100 MB."""


def main() -> int:
    """Run `lerobot-train` with the flags of this process, on a dataset in memory."""
    return run_program("lerobot-bimanual-train", _check, _train, progress=True)


def _check(values: Mapping[str, str]) -> None:
    kept = values.get(KEEP_FLAG, "1")
    if not kept.isdecimal() or int(kept) < 1:
        raise BadCommandLine(
            f"--{KEEP_FLAG} is {plain(kept)}, but must be a number of checkpoints, 1 or more"
        )
    config, output = Path(values.get("config_path", "")), values.get("output_dir", "")
    if values.get("resume", "false").lower() not in NO:
        folder = config if config.is_dir() else config.parent
        if config.exists() and not (folder / TRAIN_CONFIG_FILE).is_file():
            raise BadCommandLine(
                f"--resume goes with the --config_path of a checkpoint; {how_to_resume(Path(output or config))}"
            )
    elif output and Path(output).is_dir():
        raise BimanualError(
            f"--output_dir={output} is there already: choose another; {how_to_resume(Path(output))}"
        )
    if root := values.get("dataset.root"):
        from lerobot_policy_bimanual.training.dataset_folder import check_dataset

        check_dataset(Path(root))
    if "dataset.repo_id" not in values and "config_path" not in values:
        raise BadCommandLine(
            "--dataset.repo_id is missing: give OWNER/NAME on the Hub, or, with --dataset.root, any name such as local/data"
        )


def _train(values: Mapping[str, str]) -> None:
    keep_freed_memory()
    from lerobot.utils.import_utils import register_third_party_plugins

    from lerobot_policy_bimanual.training.train import train

    register_third_party_plugins()
    # The config is made of the flags.
    train(keep_last=int(values[KEEP_FLAG]) if KEEP_FLAG in values else None)  # pyright: ignore[reportCallIssue]


def keep_freed_memory() -> None:
    """Have glibc keep freed memory, up to `MAX_KEPT_BYTES` a piece, until the process ends.

    By default glibc gives the large maps of a training step back to the system, which zeroes every page again at the next
    step: up to a third of the step's time. Does nothing with other C libraries.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, MAX_KEPT_BYTES)
        mallopt(M_TRIM_THRESHOLD, MAX_KEPT_BYTES)
