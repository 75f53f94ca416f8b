"""A dataset goes onto the Hub whole, with its card, in one commit that gets LeRobot's version tag."""

import shutil
from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import httpx
import pytest
from huggingface_hub import DatasetCard, HfApi
from huggingface_hub.errors import HfHubHTTPError, OfflineModeIsEnabled

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import hub
from lerobot_bimanual.dataset.checksums import checksum_problems
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE

REPO_ID = "someone/balls"


@pytest.fixture
def api(monkeypatch) -> Any:
    """Takes the place of `HfApi`, whose signatures it has, and notes what is called."""
    api = create_autospec(HfApi, instance=True)
    monkeypatch.setattr(hub, "HfApi", lambda: api)
    monkeypatch.setattr(hub, "get_token", lambda: "hf_token")
    return api


@pytest.fixture
def dataset(copy) -> Path:
    return copy("keyframes")


def push(root: Path, repo_id: str = REPO_ID, *flags: str) -> int:
    return main(["dataset", "push", f"--root={root}", f"--repo_id={repo_id}", *flags])


def test_the_dataset_is_uploaded_in_one_commit_and_tagged(api, dataset) -> None:
    assert push(dataset, REPO_ID, "--private") == 0
    names, _, options = zip(*api.method_calls, strict=True)
    assert names == ("create_repo", "upload_folder", "delete_tag", "create_tag")
    created, uploaded, _, tagged = options
    assert created["private"] is True
    assert (uploaded["folder_path"], uploaded["revision"]) == (dataset, None)
    # Nothing of an earlier upload stays.
    assert uploaded["delete_patterns"] == ["data/*", "meta/*", "videos/*"]
    assert tagged["tag"] == "v3.0"
    assert list(checksum_problems(dataset)) == []
    card = DatasetCard((dataset / "README.md").read_text())
    assert {"LeRobot", "bimanual", "depth"} <= set(card.data.to_dict()["tags"])
    assert f"# {REPO_ID}" in card.text


def test_a_branch_gets_no_tag(api, dataset, capsys) -> None:
    assert push(dataset, REPO_ID, "--branch=draft") == 0
    assert f"--dataset.repo_id={REPO_ID} --dataset.revision=draft" in capsys.readouterr().err
    assert [name for name, *_ in api.method_calls] == ["create_repo", "create_branch", "upload_folder"]
    assert api.upload_folder.call_args.kwargs["revision"] == "draft"


def refused(status: int) -> HfHubHTTPError:
    return HfHubHTTPError("no", response=httpx.Response(status, request=httpx.Request("POST", "http://hub")))


@pytest.mark.parametrize(
    ("repo_id", "token", "failure", "message"),
    [
        (REPO_ID, None, None, "run `hf auth login`"),
        (REPO_ID, "old", refused(401), "it does not accept the token; run `hf auth login`"),
        (REPO_ID, "read", refused(403), "the token may not write there"),
        (REPO_ID, "good", httpx.ConnectError("no route"), "cannot reach http"),
        (REPO_ID, "good", OfflineModeIsEnabled("offline"), "HF_HUB_OFFLINE is set"),
        ("balls", "good", None, "but must be USER/NAME"),
        ("some one/balls", "good", None, "which no repository can have"),
    ],
)
def test_a_push_that_cannot_work_is_refused_on_one_line(
    api, dataset, monkeypatch, capsys, repo_id, token, failure, message
) -> None:
    monkeypatch.setattr(hub, "get_token", lambda: token)
    api.create_repo.side_effect = failure
    assert push(dataset, repo_id) == 1
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1


def test_only_one_whole_dataset_can_be_pushed(api, generated, dataset, tmp_path, capsys) -> None:
    edited, damaged = (Path(shutil.copytree(dataset, tmp_path / name)) for name in ("edited", "damaged"))
    (edited / PROVENANCE_FILE).unlink()
    (damaged / "data/chunk-000/file-000.parquet").write_bytes(b"PAR1")
    for root, message in (
        (tmp_path / "nowhere", "no LeRobot dataset at"),
        (generated, f"{generated / 'frames'} and {generated / 'keyframes'}"),
        (edited, "does not say where it comes from"),
        (damaged, "data/chunk-000/file-000.parquet has changed since it was written"),
    ):
        assert push(root) == 1
        assert message in capsys.readouterr().err
    assert not api.method_calls
