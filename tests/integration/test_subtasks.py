"""The expert's stages in words, in LeRobot's own language columns."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from lerobot.configs.recipe import MessageTurn, TrainingRecipe
from lerobot.datasets import LeRobotDataset
from lerobot.datasets.language import language_feature_info
from lerobot.lerobot_types import TransitionKey
from lerobot.processor.converters import batch_to_transition
from lerobot.processor.render_messages_processor import RenderMessagesStep

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual.verification.metadata import METADATA_CHECKS
from lerobot_env_bimanual.verification.subtasks import EVENTS, LANGUAGE_FEATURES, SUBTASKS, check_subtasks
from lerobot_policy_bimanual.inspection.loading import batch_of

pytestmark = [pytest.mark.slow, pytest.mark.sim]

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
    subprocess.run([sys.executable, str(EXAMPLE), f"--root={root}"], check=True, capture_output=True)
    return root


@pytest.fixture
def annotated(annotated_once, tmp_path) -> Callable[[schema.View], Path]:
    """Copies a view of the annotated dataset."""
    return lambda view: Path(shutil.copytree(annotated_once / view, tmp_path / f"annotated_{view}"))


@pytest.mark.parametrize("view", schema.VIEWS)
def test_lerobot_reads_which_stage_every_row_belongs_to_and_verify_finds_nothing_wrong(
    annotated, capsys, view
):
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
    assert main(["verify", f"--root={root}"]) == 0
    assert "subtasks " in capsys.readouterr().out


def test_a_dataset_without_language_columns_has_nothing_to_check(copy):
    assert not [*check_subtasks(copy("keyframes"))]
    assert language_feature_info() == LANGUAGE_FEATURES


def with_words(root: Path, change: Callable[[list[list[dict]], list[list]], object]) -> list[str]:
    """What the check says after a change of what all rows of the first file say."""
    path = min(root.glob("data/*/*.parquet"))
    table = pq.read_table(path)
    words, events = table[SUBTASKS].to_pylist(), table[EVENTS].to_pylist()
    change(words, events)
    for key, column in ((SUBTASKS, words), (EVENTS, events)):
        table = table.set_column(table.column_names.index(key), key, pa.array(column))
    pq.write_table(table, path)
    return [fault.text for fault in check_subtasks(root)]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda words, events: words[1].pop(), "other subtasks in some rows"),
        (lambda words, events: [row.pop() for row in words], "2 subtasks for 3 keyposes"),
        (
            lambda words, events: [row[1].update(timestamp=9.0) for row in words],
            "'squeeze' begins at 9 s, but",
        ),
        (lambda words, events: [row[2].update(content="") for row in words], "is no subtask in words"),
        (lambda words, events: [row[0].update(style="plan") for row in words], "is no subtask in words"),
        (lambda words, events: events[0].append("clap"), "which nobody here writes"),
    ],
)
def test_words_that_do_not_belong_to_the_keyposes_are_found(annotated, change, fault):
    faults = with_words(annotated("keyframes"), change)
    assert faults
    assert fault in faults[0]


def test_columns_that_are_declared_otherwise_than_lerobot_does_are_found(annotated):
    root = annotated("keyframes")
    info = root / "meta/info.json"
    info.write_text(info.read_text().replace(f'"{EVENTS}"', '"language_other"'))
    faults = [fault.text for fault in METADATA_CHECKS["schema"](root)]
    assert faults == [f"{EVENTS} is missing", "language_other is not in the schema"]


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


def test_rows_of_an_annotated_dataset_make_a_batch_for_inspect_and_accuracy(annotated):
    batch = batch_of(LeRobotDataset("local/annotated", root=annotated("keyframes")), range(3))
    assert batch[schema.NEXT_KEYPOSE].shape == (3, 18)
    assert not batch.keys() & LANGUAGE_FEATURES.keys()
