"""The command `dataset regenerate`: a dataset from its provenance."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.errors import BimanualError, DatasetError


@dataclass
class DatasetRegenerateConfig:
    """Options of the command `dataset regenerate`."""

    provenance: Path = field(kw_only=True)  # file `meta/bimanual.json` of a dataset, or a copy of it
    root: Path = field(kw_only=True)  # new folder of the dataset
    workers: int = 0  # processes; 0 takes one per core


def dataset_regenerate(config: DatasetRegenerateConfig) -> None:
    """Make a dataset again from its provenance, a file of about a hundred bytes per episode.

    The file is `meta/bimanual.json`, which `dataset generate` writes into every view; one view's file makes all views. The
    installed simulation must have the versions that it names. Can be interrupted and repeated as `dataset generate`.

    Only the settings of the dataset are taken from the file. Its command is for people to read and is never run.

    Examples:
        lerobot-bimanual dataset regenerate --provenance=lift_ball.json --root=data/lift_ball
    """
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_bimanual.dataset.reader import find_view
    from lerobot_env_bimanual.commands.dataset_generate import make_dataset
    from lerobot_env_bimanual.experts.world_version import other_simulation
    from lerobot_env_bimanual.generation.build import process_executor
    from lerobot_env_bimanual.generation.settings import GenerationSettings

    provenance = Provenance.read(config.provenance)
    if difference := other_simulation(provenance):
        raise DatasetError(
            f"{config.provenance} is of another simulation: {difference}. Install the versions that it names, and the "
            "version of this package that made it"
        )
    try:
        settings = GenerationSettings.of(**provenance.settings)
    except BimanualError as error:
        raise DatasetError(f"{config.provenance}: no dataset has these settings: {error}") from error
    make_dataset(settings, config.root, process_executor(config.workers))
    made = Provenance.of_dataset(find_view(config.root))
    if made is None or made.episodes != provenance.episodes:
        raise DatasetError(
            f"{config.root} holds other episodes than {config.provenance} lists, although settings and versions are "
            "the same: the simulation gives other results on this machine, or the file was changed"
        )
