"""Sentences that say the subtask of their row."""

import json

import pytest
import torch
from lerobot.processor import PolicyProcessorPipeline

from lerobot_bimanual.dataset.schema import ACTION
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual.checkpoint.check import PROCESSOR_FILES
from lerobot_policy_bimanual.checkpoint.steps import check_classes, step_names
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.training.subtask_step import SubtaskStep


def rows(*begins_s: float) -> list[dict]:
    """Subtasks of an episode, named by their number."""
    return [
        {"role": "assistant", "style": "subtask", "content": f"stage {index}", "timestamp": begin_s}
        for index, begin_s in enumerate(begins_s)
    ]


def batch(**columns) -> dict:
    """Two rows to learn from, of two episodes."""
    return {
        ACTION: torch.zeros(2, 16),
        "task": ["lift the ball", "push the box"],
        "timestamp": torch.tensor([0.5, 1.0]),
    } | columns


@pytest.fixture
def pipeline() -> PolicyProcessorPipeline:
    return PolicyProcessorPipeline([SubtaskStep()], name="policy_preprocessor")


def test_every_row_says_the_subtask_that_began_last(pipeline):
    said = pipeline(batch(language_persistent=[rows(0, 0.6), rows(0, 0.5, 1.0)]))
    assert said["task"] == ["lift the ball: stage 0", "push the box: stage 2"]


def test_where_nothing_is_learnt_the_sentence_stays(pipeline):
    seen = {"task": ["lift the ball"], "observation.state": torch.zeros(1, 16)}
    assert pipeline(seen)["task"] == ["lift the ball"]


def test_rows_without_the_column_name_the_program_that_keeps_it(pipeline):
    with pytest.raises(DatasetError, match=r"no 'language_persistent'.*lerobot-bimanual-train.*10_subtasks"):
        pipeline(batch())


def test_a_time_before_the_first_subtask_is_refused(pipeline):
    with pytest.raises(DatasetError, match=r"no subtask holds at 0.50 s; there are \['stage 0'\]"):
        pipeline(batch(language_persistent=[rows(0.6), rows(0)]))


def test_a_saved_preprocessor_has_the_step_again(tmp_path):
    PolicyProcessorPipeline([SubtaskStep()], name="policy_preprocessor").save_pretrained(tmp_path)
    again = PolicyProcessorPipeline.from_pretrained(tmp_path, config_filename="policy_preprocessor.json")
    said = again(batch(language_persistent=[rows(0), rows(0)]))
    assert said["task"][0] == "lift the ball: stage 0"


def test_a_checkpoint_may_name_the_step_by_its_class_and_without_options(tmp_path):
    PolicyProcessorPipeline([SubtaskStep()], name="policy_preprocessor").save_pretrained(tmp_path)
    file = tmp_path / PROCESSOR_FILES[0]
    processor = json.loads(file.read_text())
    check_classes(file, processor)
    assert step_names(file, processor, set()) == ["SubtaskStep"]
    processor["steps"][0]["config"] = {"fget": "os.system"}
    with pytest.raises(CheckpointError, match="names the class"):
        check_classes(file, processor)
