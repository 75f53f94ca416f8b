"""The same is asked for in other words."""

import functools
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.task import TaskSpec

type Templates = Mapping[str, Sequence[str]]
"""By level "1" to "3"; like a task's instructions they are filled with the words of the variation."""


@functools.cache
def paraphrases() -> Mapping[str, Templates]:
    """Of every task that has some: `instruction.toml`, beside this file."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


@register
class Instruction(Axis):
    """A policy that has learned sentences by heart fails; so does one that looks for a word that is not there."""

    name = "instruction"
    group = Group.WORDS
    levels = (1, 2, 3)
    unit = "steps from the words of the training: another verb, another sentence, an indirect request"
    summary = "the instruction is one of two that no episode of level 0 has"
    source = "chosen here, and written by hand: perturbations/axes/instruction.toml"

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether somebody has written other words for it."""
        return task.name in paraphrases()

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Draw one of the level's sentences."""
        templates = paraphrases()[start.task.spec.name][str(int(magnitude))]
        template = templates[int(rng.integers(len(templates)))]
        start.progress.instruction = template.format(**start.progress.variation.words)
