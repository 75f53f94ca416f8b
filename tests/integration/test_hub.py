"""A dataset goes onto the Hub with its card, and everyone else loads it by its name."""

import json
import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import loopback_hub
import numpy as np
import pytest
from huggingface_hub import DatasetCard
from PIL import Image

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.card import PICTURE_FILE
from lerobot_bimanual.dataset.checksums import checksum_problems
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.reader import RecordedDataset

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

REPO_ID = "someone/balls"
LOAD = """
import json, sys
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
dataset = LeRobotDataset(sys.argv[1], **json.loads(sys.argv[2]))
depth = dataset[0]["observation.images.front_depth"]
np.save("labels.npy", np.stack([item["observation.next_keypose"] for item in dataset]))
print(json.dumps([len(dataset), list(depth.shape), str(depth.dtype), str(dataset.root)]))
"""


@pytest.fixture(scope="module")
def hub() -> Iterator:
    with loopback_hub.LoopbackHub() as running:
        yield running


class Desk(loopback_hub.Desk):
    """Somebody who pushes and loads datasets."""

    def push(self, root: Path, repo_id: str = REPO_ID, *flags: str, **changes: str):
        words = ("lerobot-bimanual", "dataset", "push", f"--root={root}", f"--repo_id={repo_id}", *flags)
        return self.run(*words, **changes)

    def load(self, repo_id: str, **options: str) -> tuple[int, list[int], str, str]:
        """Length, shape and type of a depth image, and place of a dataset that LeRobot loads by its name."""
        done = self.run("python", "-c", LOAD, repo_id, json.dumps(options))
        assert done.returncode == 0, done.stderr[-4000:]
        return tuple(json.loads(done.stdout.splitlines()[-1]))


@pytest.fixture
def desk(hub, tmp_path) -> Desk:
    return Desk(tmp_path / "desk", hub.address, loopback_hub.TOKEN)


@pytest.fixture(scope="module")
def dataset(generated, tmp_path_factory) -> Path:
    """A copy whose card may be written again."""
    root = tmp_path_factory.mktemp("hub") / "balls"
    shutil.copytree(generated / "keyframes", root)
    return root


@pytest.fixture(scope="module")
def published(hub, dataset, tmp_path_factory):
    """The repository after a first push."""
    publisher = Desk(tmp_path_factory.mktemp("publisher") / "desk", hub.address, loopback_hub.TOKEN)
    done = publisher.push(dataset, REPO_ID, "--tags=certified,yes")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{hub.address}/datasets/{REPO_ID}\n"
    return hub.repositories[REPO_ID]


def test_the_repository_holds_the_dataset_in_one_tagged_commit(published, dataset) -> None:
    files = {str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file()}
    assert set(published.files("v3.0")) == files | {".gitattributes"}
    assert all(published.files("v3.0")[file] == (dataset / file).read_bytes() for file in files)
    assert published.tags == {"v3.0": published.branches["main"]}
    assert len(published.commits) == 2  # the empty one and ours
    assert str(PROVENANCE_FILE) in files


def test_the_card_is_ours_with_valid_metadata_and_its_picture(published, dataset) -> None:
    files = published.files("v3.0")
    card = DatasetCard(files["README.md"].decode())
    assert card.data.license == "apache-2.0"
    assert {"LeRobot", "bimanual", "depth", "certified", "yes"} <= set(card.data.tags)  # `yes` is a text here
    provenance = RecordedDataset(dataset).provenance
    assert provenance is not None
    assert f"# {REPO_ID}" in card.text
    assert provenance.command in card.text
    assert f"]({PICTURE_FILE})" in card.text
    picture = Image.open(BytesIO(files[str(PICTURE_FILE)]))
    assert picture.width > 2 * picture.height  # several tiles
    assert np.asarray(picture).std() > 10


def test_a_stranger_with_an_empty_cache_loads_it_by_name(published, dataset, desk) -> None:
    length, shape, dtype, root = desk.load(REPO_ID)
    labels = [episode.columns[schema.NEXT_KEYPOSE] for episode in RecordedDataset(dataset).episodes()]
    assert np.array_equal(np.load(desk.folder / "labels.npy"), np.concatenate(labels))
    assert (length, shape, dtype) == (len(np.concatenate(labels)), [1, 24, 32], "torch.float32")
    assert Path(root).is_relative_to(desk.folder)
    assert RecordedDataset(root).provenance == RecordedDataset(dataset).provenance
    assert list(checksum_problems(Path(root))) == []


def test_a_stranger_trains_on_it_by_name(published, desk, tiny_flags) -> None:
    done = desk.run(
        "lerobot-train",
        *tiny_flags["peract2"],
        "--policy.cameras=[front,left_wrist]",
        f"--dataset.repo_id={REPO_ID}",
        "--policy.device=cpu",
        "--policy.push_to_hub=false",
        "--batch_size=2",
        "--num_workers=0",
        "--steps=1",
        "--save_freq=1",
        "--output_dir=out",
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert (desk.folder / "out/checkpoints/last/pretrained_model/model.safetensors").is_file()


def test_a_second_push_leaves_nothing_of_the_first_behind(hub, dataset, desk, tmp_path) -> None:
    repo_id = "someone/twice"
    assert desk.push(dataset, repo_id).returncode == 0
    repository = hub.repositories[repo_id]
    stale = {"data/chunk-000/file-777.parquet": b"old rows", "notes/mine.txt": b"kept"}
    repository.commit("main", repository.files("main") | stale)
    assert desk.push(dataset, repo_id).returncode == 0
    files = repository.files("v3.0")
    assert "data/chunk-000/file-777.parquet" not in files
    assert files["notes/mine.txt"] == b"kept"
    assert (dataset / "meta/info.json").read_bytes() == files["meta/info.json"]


def test_a_branch_is_loaded_by_its_name_and_leaves_main_alone(hub, dataset, desk) -> None:
    repo_id = "someone/branched"
    assert desk.push(dataset, repo_id, "--branch=draft").returncode == 0
    repository = hub.repositories[repo_id]
    assert repository.tags == {}
    assert set(repository.files("main")) == {".gitattributes"}
    assert desk.load(repo_id, revision="draft")[0] > 0


@pytest.mark.parametrize(
    ("repo_id", "changes", "message"),
    [
        (REPO_ID, {"HF_TOKEN": ""}, "run `hf auth login`"),
        (REPO_ID, {"HF_TOKEN": "hf_stolen"}, "it does not accept the token; run `hf auth login`"),
        ("stranger/balls", {}, "the token may not write there"),
        ("balls", {}, "but must be USER/NAME"),
        ("some one/balls", {}, "which no repository can have"),
        (REPO_ID, {"HF_ENDPOINT": "http://127.0.0.1:9"}, "cannot reach http://127.0.0.1:9"),
        (REPO_ID, {"HF_HUB_OFFLINE": "1"}, "HF_HUB_OFFLINE is set"),
    ],
)
def test_a_push_that_cannot_be_is_one_clear_line(dataset, desk, repo_id, changes, message) -> None:
    done = desk.push(dataset, repo_id, **changes)
    assert done.returncode == 1
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_only_one_whole_dataset_can_be_pushed(generated, dataset, desk, tmp_path) -> None:
    shutil.copytree(dataset, tmp_path / "edited")
    (tmp_path / "edited" / PROVENANCE_FILE).unlink()
    shutil.copytree(dataset, tmp_path / "damaged")
    (tmp_path / "damaged/data/chunk-000/file-000.parquet").write_bytes(b"PAR1")
    for root, message in (
        (tmp_path / "nowhere", "no LeRobot dataset at"),
        (generated, f"{generated / 'frames'} and {generated / 'keyframes'}"),
        (tmp_path / "edited", "does not say where it comes from"),
        (tmp_path / "damaged", "data/chunk-000/file-000.parquet has changed since it was written"),
    ):
        done = desk.push(root)
        assert done.returncode == 1
        assert message in done.stderr
