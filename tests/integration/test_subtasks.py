"""The expert's stages in words, in LeRobot's own language columns."""

import json
import shutil
from pathlib import Path

import pytest
import torch
from lerobot.configs.recipe import MessageTurn, TrainingRecipe
from lerobot.datasets import LeRobotDataset
from lerobot.datasets.language import LANGUAGE_PERSISTENT
from lerobot.lerobot_types import TransitionKey
from lerobot.processor import PolicyProcessorPipeline
from lerobot.processor.converters import batch_to_transition
from lerobot.processor.render_messages_processor import RenderMessagesStep
from lerobot.utils.collate import lerobot_collate_fn
from lerobot.utils.constants import OBS_LANGUAGE_TOKENS
from programs import run
from tiny_clip import save_clip

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import schema
from lerobot_policy_bimanual.inspection.loading import batch_of
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

pytestmark = [pytest.mark.slow, pytest.mark.sim]

EXAMPLE = Path(__file__).parents[2] / "examples/10_subtasks.py"
TOLD = EXAMPLE.with_name("11_subtask_policy.py")
SENTENCE_STEPS = [
    "SubtaskStep",
    "RenameObservationsProcessorStep",
    "AddBatchDimensionProcessorStep",
    "TokenizerProcessorStep",
]
"""Of the preprocessor that the example makes: the first, up to the one that makes tokens."""
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


@pytest.fixture(scope="module")
def told(annotated_once, tmp_path_factory) -> Path:
    """Multi-Task DiT that knows nothing yet, with its preprocessor, made as the example says."""
    folder = tmp_path_factory.mktemp("told")
    save_clip(folder / "tiny_clip")
    small = ("--cameras=front,left_wrist", "--hidden_dim=32", "--num_layers=1")
    places = (f"--root={annotated_once / 'frames'}", f"--clip={folder / 'tiny_clip'}", "--output=dit")
    run("python", str(TOLD), *places, *small, folder=folder)
    assert main(["policy", "check", f"--checkpoint={folder / 'dit'}"]) == 3  # CLIP is looked up
    return folder / "dit"


def training(root: Path) -> list[str]:
    """Flags for two steps on a dataset."""
    return [
        *("--dataset.repo_id=local/annotated", f"--dataset.root={root}", "--output_dir=trained"),
        *("--steps=2", "--save_freq=2", "--batch_size=2", "--num_workers=0"),
    ]


def test_a_stock_policy_that_is_told_its_subtask_trains_and_reads_it_in_every_row(
    told, annotated_once, tmp_path
):
    root = annotated_once / "frames"
    policy = (f"--policy.path={told}", "--policy.push_to_hub=false", *training(root))
    said = run("lerobot-bimanual-train", *policy, folder=tmp_path, fails=True)
    assert "the policy 'multi_task_dit' loads" in said
    run("lerobot-bimanual-train", *policy, "--trust_checkpoint=true", folder=tmp_path)
    trained = tmp_path / "trained/checkpoints/last/pretrained_model"
    dataset = LeRobotDataset("local/annotated", root=root)
    rows = ResidentDataset(dataset, torch.device("cpu"), images=())
    first = range(dataset.meta.episodes[0]["length"])
    batch = rows.batch(lerobot_collate_fn([rows[index] for index in first]))
    preprocessor = PolicyProcessorPipeline.from_pretrained(
        trained, config_filename="policy_preprocessor.json"
    )
    preprocessor.steps = preprocessor.steps[: 1 + SENTENCE_STEPS.index("TokenizerProcessorStep")]
    assert [type(step).__name__ for step in preprocessor.steps] == SENTENCE_STEPS
    tokens = [tuple(row.tolist()) for row in preprocessor(batch)[OBS_LANGUAGE_TOKENS]]
    stages = [min(int(step), len(STAGES) - 1) for step in batch[schema.KEYPOSE_STEP]]
    assert len(set(batch["task"])) == 1
    assert len(set(tokens)) == len(set(zip(stages, tokens, strict=True))) == len(STAGES)


def test_where_loaders_drop_the_columns_its_training_is_refused(told, annotated_once, tmp_path):
    flags = (f"--policy.path={told}", "--policy.push_to_hub=false", *training(annotated_once / "frames"))
    dropped = LANGUAGE_PERSISTENT not in lerobot_collate_fn([{LANGUAGE_PERSISTENT: [], "index": 0}])
    said = run("lerobot-train", *flags, folder=tmp_path, fails=dropped)
    assert ("train it with `lerobot-bimanual-train`" in said) == dropped


def test_rows_of_an_annotated_dataset_make_a_batch_for_inspect_and_accuracy(annotated_once):
    batch = batch_of(LeRobotDataset("local/annotated", root=annotated_once / "keyframes"), range(3))
    assert batch[schema.NEXT_KEYPOSE].shape == (3, 18)
