"""The card of a dataset: what it says."""

import re
import shutil
from pathlib import Path

import pytest
from lerobot.utils.constants import DEFAULT_FEATURES
from sample_results import provenance

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.reader import read_info


@pytest.fixture(params=schema.VIEWS)
def root(request, datasets, tmp_path: Path) -> Path:
    """A dataset of two episodes, of three seeds that were tried."""
    root = tmp_path / request.param
    shutil.copytree(datasets[request.param], root)
    provenance(request.param).write(root / PROVENANCE_FILE)
    return root


def test_a_card_explains_every_column_and_how_to_make_the_dataset_again(root, snapshot) -> None:
    write_card(root, "me/lift_ball")
    card = (root / "README.md").read_text()
    described = re.findall(r"^\| `(\S+)`", card, re.MULTILINE)
    assert read_info(root)["features"].keys() - DEFAULT_FEATURES <= {*described}
    assert card == snapshot
