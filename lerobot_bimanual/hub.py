"""Repositories on the Hugging Face Hub: made, and every refusal told in one line."""

import contextlib
from collections.abc import Iterator
from http import HTTPStatus
from typing import Literal

from huggingface_hub import HfApi, constants, get_token
from huggingface_hub.errors import HfHubHTTPError, HFValidationError, OfflineModeIsEnabled
from huggingface_hub.utils import validate_repo_id

from lerobot_bimanual.errors import BimanualError

TransportError: type[Exception] = HfHubHTTPError.__bases__[0]
"""What the HTTP library raises, whichever this version of huggingface-hub brings along."""

type RepositoryType = Literal["dataset", "model"]
"""LeRobot looks for datasets in the one, for policies and environments in the other."""


def open_repository(repo_id: str, *, repo_type: RepositoryType, private: bool = False) -> None:
    """Make a repository unless it exists.

    Args:
        repo_id: USER/NAME or ORGANISATION/NAME.
        repo_type: what it holds.
        private: hide a new repository from others; an existing one stays as it is.

    Raises:
        BimanualError: the name is malformed, nobody is logged in, or the Hub refuses or cannot be reached.
    """
    check_name(repo_id)
    if get_token() is None:
        raise BimanualError("not logged in to the Hugging Face Hub; run `hf auth login`, or set HF_TOKEN")
    with plain_errors(repo_id):
        HfApi().create_repo(repo_id, repo_type=repo_type, private=private or None, exist_ok=True)


def check_name(repo_id: str) -> None:
    """Refuse what is no name of a repository, or does not say whose it is.

    Raises:
        BimanualError: it is such a name.
    """
    try:
        validate_repo_id(repo_id)
    except HFValidationError as error:
        raise BimanualError(f"{repo_id!r} is no name on the Hugging Face Hub: {error}") from error
    if "/" not in repo_id:
        raise BimanualError(f"{repo_id!r} does not say whose it is; name it USER/NAME or ORGANISATION/NAME")


@contextlib.contextmanager
def plain_errors(repo_id: str) -> Iterator[None]:
    """Turn what the Hub and the network answer into one clear message."""
    try:
        yield
    except OfflineModeIsEnabled as error:
        raise BimanualError("HF_HUB_OFFLINE is set, so the Hub is out of reach; unset it to push") from error
    except HfHubHTTPError as error:
        status = error.response.status_code
        if status == HTTPStatus.UNAUTHORIZED:
            reason = "it does not accept the token; run `hf auth login`"
        elif status == HTTPStatus.FORBIDDEN:
            reason = (
                "the token may not write there; check its rights, and whether the name begins with your own"
            )
        else:
            reason = f"{error.server_message or error}"
        raise BimanualError(f"the Hub refused the push to {repo_id}: {reason}") from error
    except TransportError as error:
        raise BimanualError(f"cannot reach {constants.ENDPOINT}: {error}") from error
