"""The subtask of a row, said to a policy that reads sentences."""

from typing import Any

from lerobot.configs import PipelineFeatureType, PolicyFeature
from lerobot.datasets.language import LANGUAGE_PERSISTENT
from lerobot.datasets.language_render import active_at
from lerobot.lerobot_types import EnvTransition, TransitionKey
from lerobot.processor import ProcessorStep
from torch import Tensor

from lerobot_bimanual.errors import DatasetError


class SubtaskStep(ProcessorStep):
    """Adds to each row's sentence the subtask that LeRobot's language columns have for its time: "lift the ball: squeeze".

    It stands first in a preprocessor, before the step that makes batches, which drops these columns, and the one that makes
    tokens of sentences; examples/11_subtask_policy.py puts it there. Loaders of `lerobot-train` 0.6.1 drop the columns, too:
    `lerobot-bimanual-train` keeps them. When a policy acts there is no column, and the sentence stays as it is: who plays
    says the subtask, in the sentence, or does not.
    """

    def __call__(self, transition: EnvTransition) -> EnvTransition:
        """The transition of a batch with other sentences.

        Raises:
            DatasetError: rows to learn from without a subtask.
        """
        known: dict[str, Any] = dict(transition.get(TransitionKey.COMPLEMENTARY_DATA) or {})
        if transition.get(TransitionKey.ACTION) is None:
            return transition
        if LANGUAGE_PERSISTENT not in known:
            raise DatasetError(
                f"this policy is told its subtask, but the rows hold no {LANGUAGE_PERSISTENT!r}: train it with "
                "`lerobot-bimanual-train` (LeRobot's loaders drop the column), on a dataset that has it "
                "(examples/10_subtasks.py)"
            )
        times_s: Tensor = known["timestamp"]
        known["task"] = [
            _said(task, rows, time_s)
            for task, rows, time_s in zip(
                known["task"], known[LANGUAGE_PERSISTENT], times_s.flatten().tolist(), strict=True
            )
        ]
        said: Any = transition.copy()
        said[TransitionKey.COMPLEMENTARY_DATA] = known
        return said

    def transform_features(
        self, features: dict[PipelineFeatureType, dict[str, PolicyFeature]]
    ) -> dict[PipelineFeatureType, dict[str, PolicyFeature]]:
        """The features as they are: only sentences change."""
        return features


def _said(task: str, rows: list[dict[str, Any]], time_s: float) -> str:
    subtask = active_at(time_s, persistent=rows, style="subtask")
    if subtask is None:
        raise DatasetError(
            f"no subtask holds at {time_s:.2f} s; there are {[row['content'] for row in rows]} "
            "(`lerobot-bimanual dataset verify` says what is wrong with a dataset)"
        )
    return f"{task}: {subtask['content']}"
