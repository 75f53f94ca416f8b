"""Whether the dataset that is asked for lies at its place already: all of it, unchanged, and of the same origin."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, Provenance
from lerobot_bimanual.dataset.schema import VIEWS, View
from lerobot_bimanual.dataset.seal import seal_problems
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.experts.world_version import other_worlds
from lerobot_env_bimanual.generation.origin import Origin
from lerobot_env_bimanual.generation.settings import GenerationSettings

MOST_PROBLEMS = 3
"""As many are told of one view."""


def is_published(root: Path, origin: Origin) -> bool:
    """Whether the dataset is complete at its place; False if nothing is there.

    Every file is read, as its seal asks for.

    Args:
        root: the place.
        origin: of the dataset that is asked for.

    Raises:
        DatasetError: something else is there, or a part of the dataset is missing or changed.
    """
    if not root.exists() or (root.is_dir() and not any(root.iterdir())):
        return False
    found = [
        place for place in (root, *(root / view for view in VIEWS)) if (place / PROVENANCE_FILE).exists()
    ]
    if not found:
        raise DatasetError(
            f"{root} exists and was not made by this command; choose another --root or remove it"
        )
    for place in found:
        origin.refuse_at(root, _origin_of(place))
    problems = [
        problem
        for view in origin.settings.views
        for problem in islice(
            _problems(view_folder(root, origin.settings, view), view, origin), MOST_PROBLEMS
        )
    ]
    if problems:
        raise DatasetError(
            f"{root} is not the dataset that was made there: {'; '.join(problems)}. Nothing was changed: restore it, "
            "or remove the folder and repeat the command"
        )
    return True


def view_folder(root: Path, settings: GenerationSettings, view: str) -> Path:
    """Folder of one view of a dataset: `root` itself if it is the only one, otherwise `root/<view>`."""
    return root if settings.views == (view,) else root / view


def _origin_of(place: Path) -> Origin:
    try:
        provenance = Provenance.load(place / PROVENANCE_FILE)
        return Origin.from_dict({"settings": provenance.settings, "versions": provenance.versions})
    except BimanualError as error:
        raise DatasetError(
            f"{place} does not say any more what it is: {error}. Nothing was changed: restore the file, or remove the "
            "dataset and repeat the command"
        ) from error


def _problems(folder: Path, view: View, origin: Origin) -> Iterator[str]:
    if not folder.is_dir():
        yield f"the view {folder} is missing"
        return
    for problem in seal_problems(folder):
        yield f"in {folder}, {problem}"
    provenance = Provenance.read(folder)
    if provenance is None:
        return  # which the seal has told
    if provenance.view != view:
        yield f"{folder} holds the view {provenance.view!r}"
    if others := other_worlds(provenance.worlds, origin.settings.perturb):
        yield f"{folder} holds {others}, where the same seeds mean other episodes"
    if (count := len(provenance.episodes)) != origin.settings.total_episodes:
        yield f"{folder} has {count} episodes, not {origin.settings.total_episodes}"
