"""The verb `regenerate`: a dataset from its recipe."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import DatasetError

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_env_bimanual.commands.generate import GenerateConfig


@dataclass
class RegenerateConfig:
    """Options of the verb `regenerate`."""

    recipe: Path = field(kw_only=True)  # file `meta/bimanual.json` of a dataset, or a copy of it
    root: Path = field(kw_only=True)  # new folder of the dataset
    workers: int = 0  # processes; 0 takes one per core


def regenerate(config: RegenerateConfig) -> None:
    """Make a dataset again from its recipe, a file of about a hundred bytes per episode.

    The recipe is `meta/bimanual.json`, which `generate` writes into every view; one view's recipe makes all views. The
    installed simulation must have the versions that the recipe names. Can be interrupted and repeated as `generate`.

    Examples:
        lerobot-bimanual regenerate --recipe=lift_ball.json --root=data/lift_ball
    """
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_bimanual.dataset.reader import find_view
    from lerobot_env_bimanual.commands.generate import generate

    recipe = Provenance.load(config.recipe)
    refuse_other_versions(recipe, config.recipe)
    generate(generation_config(recipe, config))
    made = Provenance.read(find_view(config.root))
    if made is None or list(made.episodes) != list(recipe.episodes):
        raise DatasetError(
            f"{config.root} holds other episodes than {config.recipe} lists, although settings and versions are the "
            "same: the simulation gives other results on this machine, or the recipe was changed"
        )


def generation_config(recipe: Provenance, config: RegenerateConfig) -> GenerateConfig:
    """The options of `generate` that make a recipe's dataset at a new place.

    Raises:
        DatasetError: the recipe's command does not belong to its settings.
    """
    from lerobot_bimanual.cli.flags import parse_flags
    from lerobot_env_bimanual.commands.generate import GenerateConfig
    from lerobot_env_bimanual.generation.settings import GenerationSettings

    _, _, *flags = shlex.split(recipe.command)
    options = replace(parse_flags(GenerateConfig, flags), root=config.root, workers=config.workers)
    differences = GenerationSettings.from_dict(recipe.settings).differences(GenerationSettings.parse(options))
    if differences:
        raise DatasetError(f"{config.recipe}: settings and command disagree: {'; '.join(differences)}")
    return options


def refuse_other_versions(recipe: Provenance, place: Path) -> None:
    """Make sure that seeds mean here what they meant to the recipe.

    Raises:
        DatasetError: the installed simulation is another one; the message says what to install.
    """
    from lerobot_env_bimanual.generation.versions import other_versions

    if others := other_versions(recipe):
        found = ", ".join(f"{package} {installed}" for package, (_, installed) in others.items())
        wanted = " ".join(f"{package}=={recorded}" for package, (recorded, _) in others.items())
        raise DatasetError(
            f"{place} was made with another simulation, in which seeds mean other episodes; installed: {found}. "
            f"Make it in an environment with `pip install {wanted}`"
        )
