"""The expert's stages in words, in LeRobot's own language columns."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from lerobot.configs.recipe import MessageTurn, TrainingRecipe
from lerobot.datasets import LeRobotDataset
from lerobot.lerobot_types import TransitionKey
from lerobot.processor import PolicyProcessorPipeline
from lerobot.processor.converters import batch_to_transition
from lerobot.processor.render_messages_processor import RenderMessagesStep
from lerobot.utils.collate import lerobot_collate_fn
from lerobot.utils.constants import OBS_LANGUAGE_TOKENS
from tiny_clip import save_clip

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual.verification.metadata import LANGUAGE_COLUMNS
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
    subprocess.run([sys.executable, str(EXAMPLE), f"--root={root}"], check=True, capture_output=True)
    return root


@pytest.fixture
def annotated(annotated_once, tmp_path) -> Callable[[schema.View], Path]:
    """Copies a view of the annotated dataset."""
    return lambda view: Path(shutil.copytree(annotated_once / view, tmp_path / f"annotated_{view}"))


@pytest.mark.parametrize("view", schema.VIEWS)
def test_lerobot_reads_which_stage_every_row_belongs_to_and_verify_finds_nothing_wrong(annotated, view):
    root = annotated(view)
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


@pytest.mark.parametrize("view", schema.VIEWS)
def test_lerobots_act_trains_on_annotated_datasets(annotated, tmp_path, view):
    flags = [
        *("--policy.type=act", "--policy.pretrained_backbone_weights=null", "--policy.device=cpu"),
        *(
            "--policy.push_to_hub=false",
            "--policy.chunk_size=2",
            "--policy.n_action_steps=2",
            "--policy.dim_model=64",
        ),
        '--policy.input_features={"observation.state": {"type": "STATE", "shape": [16]}, '
        '"observation.images.front": {"type": "VISUAL", "shape": [3, 24, 32]}}',
        *("--dataset.repo_id=local/annotated", f"--dataset.root={annotated(view)}", "--num_workers=0"),
        *("--batch_size=2", "--steps=2", "--save_freq=2", f"--output_dir={tmp_path / 'act'}"),
    ]
    command = [sys.executable, "-m", "lerobot.scripts.lerobot_train", *flags]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr[-4000:]
    assert (tmp_path / "act/checkpoints/last/pretrained_model/model.safetensors").is_file()


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A program of this environment."""
    program = Path(sys.executable).parent / words[0]
    return subprocess.run([str(program), *words[1:]], cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def told(annotated_once, tmp_path_factory) -> Path:
    """Multi-Task DiT that knows nothing yet, with its preprocessor, made as the example says."""
    folder = tmp_path_factory.mktemp("told")
    save_clip(folder / "tiny_clip")
    small = ("--cameras=front,left_wrist", "--hidden_dim=32", "--num_layers=1")
    places = (f"--root={annotated_once / 'frames'}", f"--clip={folder / 'tiny_clip'}", "--output=dit")
    made = run("python", str(TOLD), *places, *small, folder=folder)
    assert made.returncode == 0, made.stderr[-4000:]
    assert main(["policy", "check", f"--checkpoint={folder / 'dit'}"]) == 0
    return folder / "dit"


def training(policy: Path, root: Path) -> list[str]:
    return [
        *(f"--policy.path={policy}", "--policy.push_to_hub=false", "--batch_size=2", "--num_workers=0"),
        *("--dataset.repo_id=local/annotated", f"--dataset.root={root}", "--output_dir=trained"),
        *("--steps=2", "--save_freq=2"),
    ]


def test_a_stock_policy_that_is_told_its_subtask_trains_and_reads_it_in_every_row(
    told, annotated_once, tmp_path
):
    root = annotated_once / "frames"
    done = run("lerobot-bimanual-train", *training(told, root), folder=tmp_path)
    assert done.returncode == 0, done.stderr[-4000:]
    trained = tmp_path / "trained/checkpoints/last/pretrained_model"
    rows = ResidentDataset(LeRobotDataset("local/annotated", root=root), torch.device("cpu"), images=())
    batch = rows.batch(lerobot_collate_fn([rows[index] for index in range(rows.meta.episodes[0]["length"])]))
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
    done = run("lerobot-train", *training(told, annotated_once / "frames"), folder=tmp_path)
    assert done.returncode != 0
    assert "train it with `lerobot-bimanual-train`" in done.stderr


def test_rows_of_an_annotated_dataset_make_a_batch_for_inspect_and_accuracy(annotated):
    batch = batch_of(LeRobotDataset("local/annotated", root=annotated("keyframes")), range(3))
    assert batch[schema.NEXT_KEYPOSE].shape == (3, 18)
    assert not batch.keys() & set(LANGUAGE_COLUMNS)
