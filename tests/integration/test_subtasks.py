"""The expert's stages in words, in LeRobot's own language columns."""

import shutil
from pathlib import Path

import pytest
import torch
from lerobot.configs.recipe import MessageTurn, TrainingRecipe
from lerobot.datasets import LeRobotDataset
from lerobot.datasets.language import LANGUAGE_PERSISTENT
from lerobot.lerobot_types import TransitionKey
from lerobot.processor.converters import batch_to_transition
from lerobot.processor.render_messages_processor import RenderMessagesStep
from lerobot.utils.collate import lerobot_collate_fn
from programs import run

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import schema
from lerobot_policy_bimanual.inspection.loading import batch_of
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

pytestmark = pytest.mark.weekly

EXAMPLE = Path(__file__).parents[2] / "examples/10_subtasks.py"
STAGES = ["beside", "squeeze", "lift"]
SAY_THE_SUBTASK = TrainingRecipe(
    messages=[
        MessageTurn(role="user", content="${task}", stream="high_level"),
        MessageTurn(role="assistant", content="${subtask}", stream="low_level", target=True),
    ]
)


@pytest.fixture(scope="module")
def annotated_once(generated, tmp_path_factory) -> Path:
    root = Path(shutil.copytree(generated, tmp_path_factory.mktemp("annotated") / "small"))
    run("python", str(EXAMPLE), f"--root={root}", folder=root)
    return root


@pytest.mark.parametrize("view", schema.VIEWS)
def test_lerobot_reads_which_stage_every_row_belongs_to_and_verify_finds_nothing_wrong(annotated_once, view):
    root = annotated_once / view
    dataset = LeRobotDataset("local/annotated", root=root)
    assert dataset.meta.has_language_columns
    said = []
    for row in (dataset[index] for index in range(dataset.meta.episodes[0]["length"] - 1)):
        transition = RenderMessagesStep(SAY_THE_SUBTASK)(batch_to_transition(row))
        task, subtask = transition[TransitionKey.COMPLEMENTARY_DATA]["messages"]
        assert task["content"] == row["task"]
        assert subtask["content"] == STAGES[int(row[schema.KEYPOSE_STEP])]
        said.append(subtask["content"])
    assert list(dict.fromkeys(said)) == STAGES
    assert main(["dataset", "verify", f"--root={root}"]) == 0


def test_rows_of_an_annotated_dataset_make_a_batch_and_keep_their_words_in_memory(annotated_once):
    dataset = LeRobotDataset("local/annotated", root=annotated_once / "keyframes")
    assert batch_of(dataset, range(3))[schema.ACTION].shape == (3, 18)
    held = ResidentDataset(dataset, torch.device("cpu"))
    batch = held.batch(lerobot_collate_fn([held[row] for row in range(3)]))
    words = [[said["content"] for said in row] for row in batch[LANGUAGE_PERSISTENT]]
    assert words == [STAGES] * 3
