"""Datasets on the Hugging Face Hub.

What `LeRobotDataset.push_to_hub` does, with three differences: our card is part of the one commit (LeRobot's own
replaces it by a general one in a second commit, and tags that), files of an earlier upload do not stay behind (a
loader would take stale parquet files for further rows), and every request goes to `HF_ENDPOINT` (LeRobot's card is
always validated at huggingface.co, so its push to another Hub ends after the upload and before the tag).
"""

import contextlib
from http import HTTPStatus
from pathlib import Path

from huggingface_hub import HfApi, constants, errors, get_token
from huggingface_hub.utils import validate_repo_id

from lerobot_bimanual.dataset.card import CARD_FILE, write_card
from lerobot_bimanual.dataset.checksums import checksum_problems, write_checksums
from lerobot_bimanual.dataset.reader import RecordedDataset, read_info, views_below
from lerobot_bimanual.errors import BimanualError, DatasetError

TransportError: type[Exception] = errors.HfHubHTTPError.__bases__[0]
"""Base of the errors of the HTTP library that this version of huggingface-hub uses."""
REASONS: dict[int, str] = {
    HTTPStatus.UNAUTHORIZED: "it does not accept the token; run `hf auth login`",
    HTTPStatus.FORBIDDEN: "the token may not write there; check its rights, and the owner in the name",
}
DATASET_FILES = ("data/*", "meta/*", "videos/*")
"""Everything that a LeRobotDataset consists of; the Hub's patterns cross folders."""


def check_repo_id(repo_id: str) -> None:
    """Refuse a name that no repository of the Hub can have: one that is malformed, or names no owner."""
    try:
        validate_repo_id(repo_id)
    except errors.HFValidationError as error:
        raise BimanualError(f"repo_id is {repo_id!r}, which no repository can have: {error}") from error
    if "/" not in repo_id:
        raise BimanualError(f"repo_id is {repo_id!r}, but must be USER/NAME or ORGANISATION/NAME")


def push_dataset(root: Path, repo_id: str, *, private: bool = False, branch: str | None = None) -> str:
    """Make a repository, new or not, hold exactly this dataset, with its card, in one commit.

    The commit on `main` gets LeRobot's version tag, the revision that `LeRobotDataset(repo_id)` asks for. One on
    another branch gets none, and is loaded with `revision=branch`.

    Args:
        root: folder of the dataset; its card and its checksums are written again with the name of the repository.
        repo_id: USER/NAME or ORGANISATION/NAME.
        private: hide a new repository from others; an existing one stays as it is.
        branch: branch instead of `main`; made if it does not exist.

    Returns:
        Address of the dataset.

    Raises:
        BimanualError: the folder is not one dataset as it was published, with its provenance; the name is malformed, no
            user is logged in, or the Hub refuses or cannot be reached; what was uploaded so far is not uploaded again.
    """
    _check_pushable(root)
    check_repo_id(repo_id)
    if get_token() is None:
        raise BimanualError("not logged in to the Hugging Face Hub; run `hf auth login`, or set HF_TOKEN")
    hub = HfApi()
    try:
        hub.create_repo(repo_id, repo_type="dataset", private=private or None, exist_ok=True)
        write_card(root, repo_id)
        write_checksums(root)
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
            with contextlib.suppress(errors.RevisionNotFoundError):
                hub.delete_tag(repo_id, tag=version, repo_type="dataset")
            hub.create_tag(repo_id, tag=version, repo_type="dataset")
    except errors.OfflineModeIsEnabled as error:
        raise BimanualError("HF_HUB_OFFLINE is set, so the Hub is out of reach; unset it to push") from error
    except errors.HfHubHTTPError as error:
        status = error.response.status_code
        reason = REASONS.get(status) or error.server_message or error
        raise BimanualError(f"the Hub refused the push to {repo_id}: {reason}") from error
    except TransportError as error:
        raise BimanualError(f"cannot reach {constants.ENDPOINT}: {error}") from error
    return f"{constants.ENDPOINT}/datasets/{repo_id}" + (f"/tree/{branch}" if branch else "")


def _check_pushable(root: Path) -> None:
    """Refuse a folder that is not one whole dataset of this package with its provenance."""
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
    if problem := next(checksum_problems(root, rewritten=(CARD_FILE,)), None):
        raise DatasetError(
            f"{root} is no longer as it was written: {problem}. Only an unchanged dataset can be pushed: restore it, or "
            "generate it again"
        )
