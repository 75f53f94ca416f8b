"""Datasets on the Hugging Face Hub.

What `LeRobotDataset.push_to_hub` does, with three differences: our card is part of the one commit (LeRobot's own
replaces it by a general one in a second commit, and tags that), files of an earlier upload do not stay behind (a
loader would take stale parquet files for further rows), and every request goes to `HF_ENDPOINT` (LeRobot's card is
always validated at huggingface.co, so its push to another Hub ends after the upload and before the tag).
"""

import contextlib
from collections.abc import Sequence
from pathlib import Path

from huggingface_hub import HfApi, constants
from huggingface_hub.errors import RevisionNotFoundError

from lerobot_bimanual.dataset.card import CARD_FILE, write_card
from lerobot_bimanual.dataset.picture import PICTURE_FILE
from lerobot_bimanual.dataset.reader import RecordedDataset, read_info, views_below
from lerobot_bimanual.dataset.seal import seal_problems, write_seal
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.hub import plain_errors

DATASET_FILES = ("data/*", "meta/*", "videos/*")
"""Everything that a LeRobotDataset consists of; the Hub's patterns cross folders."""


def pushable_folder(root: Path) -> Path:
    """`root`, if one whole dataset of this package lies there and says where it comes from.

    Raises:
        DatasetError: there is none, there are two, it has no provenance, or it is not as it was sealed.
        SchemaMismatch: the dataset is of another package or version.
    """
    if views := views_below(root):
        raise DatasetError(
            f"{root} holds {' and '.join(map(str, views))}; push each to a repository of its own, "
            f"for example with --root={views[-1]}"
        )
    if RecordedDataset(root).provenance is None:
        raise DatasetError(
            f"{root} does not say where it comes from, as after an edit with LeRobot's tools, so it can have no card. "
            "Generate a dataset of what you want to share, or push this one with LeRobotDataset.push_to_hub"
        )
    if problem := next(seal_problems(root, rewritten=(CARD_FILE, PICTURE_FILE)), None):
        raise DatasetError(
            f"{root} is not the dataset that was made there: {problem}. What goes onto the Hub should be whole: restore "
            "it, or generate it again"
        )
    return root


def upload_dataset(root: Path, repo_id: str, *, branch: str | None = None, tags: Sequence[str] = ()) -> str:
    """Make an existing repository hold exactly this dataset, with its card, in one commit.

    The commit on `main` gets LeRobot's version tag, the revision that `LeRobotDataset(repo_id)` asks for. One on
    another branch gets none, and is loaded with `revision=branch`.

    Args:
        root: folder of the dataset; its card is written again with the name of the repository, and sealed anew.
        repo_id: USER/NAME or ORGANISATION/NAME.
        branch: branch instead of `main`; made if it does not exist.
        tags: further tags of the card.

    Returns:
        Address of the dataset.

    Raises:
        BimanualError: the Hub refuses or cannot be reached; what was uploaded so far is not uploaded again.
    """
    write_card(root, repo_id, tags)
    write_seal(root)
    hub = HfApi()
    with plain_errors(repo_id):
        if branch is not None:
            hub.create_branch(repo_id, branch=branch, repo_type="dataset", exist_ok=True)
        hub.upload_folder(
            repo_id=repo_id,
            repo_type="dataset",
            folder_path=root,
            revision=branch,
            allow_patterns=[*DATASET_FILES, CARD_FILE.as_posix()],
            delete_patterns=list(DATASET_FILES),
            commit_message="Upload dataset with lerobot_bimanual",
        )
        if branch is None:
            version = read_info(root)["codebase_version"]
            with contextlib.suppress(RevisionNotFoundError):
                hub.delete_tag(repo_id, tag=version, repo_type="dataset")
            hub.create_tag(repo_id, tag=version, repo_type="dataset")
    return f"{constants.ENDPOINT}/datasets/{repo_id}" + (f"/tree/{branch}" if branch else "")
