"""The expert's stages in words, in LeRobot's own language columns."""

import json
import shutil
from pathlib import Path

import pytest
from lerobot.configs.recipe import MessageTurn, TrainingRecipe
from lerobot.datasets import LeRobotDataset
from lerobot.lerobot_types import TransitionKey
from lerobot.processor.converters import batch_to_transition
from lerobot.processor.render_messages_processor import RenderMessagesStep
from programs import run

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import schema
from lerobot_policy_bimanual.inspection.loading import batch_of

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


def test_lerobots_act_trains_on_annotated_datasets(annotated_once, tmp_path):
    inputs = {"observation.state": ("STATE", [16]), "observation.images.front": ("VISUAL", [3, 24, 32])}
    features = json.dumps({key: {"type": kind, "shape": shape} for key, (kind, shape) in inputs.items()})
    policy = ("--policy.type=act", "--policy.pretrained_backbone_weights=null", "--policy.device=cpu")
    size = ("--policy.chunk_size=2", "--policy.n_action_steps=2", "--policy.dim_model=64")
    flags = (*policy, *size, f"--policy.input_features={features}", "--policy.push_to_hub=false")
    run("lerobot-train", *flags, *training(annotated_once / "frames"), folder=tmp_path)
    assert (tmp_path / "trained/checkpoints/last/pretrained_model/model.safetensors").is_file()


def training(root: Path) -> list[str]:
    """Flags for two steps on a dataset."""
    return [
        *("--dataset.repo_id=local/annotated", f"--dataset.root={root}", "--output_dir=trained"),
        *("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0"),
    ]


def test_rows_of_an_annotated_dataset_make_a_batch_for_inspect_and_accuracy(annotated_once):
    batch = batch_of(LeRobotDataset("local/annotated", root=annotated_once / "keyframes"), range(3))
    assert batch[schema.ACTION].shape == (3, 18)
