"""The axis `instruction`: the same task in other words; and the colours that instructions name."""

from __future__ import annotations

import colorsys
import functools
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, Start, data, register
from lerobot_env_bimanual.task import TaskSpec

MAX_HUES_DEG = {
    15: "red",
    45: "orange",
    70: "yellow",
    165: "green",
    190: "turquoise",
    225: "azure",
    260: "blue",
    320: "purple",
    345: "pink",
    360: "red",
}
"""Largest hue of a colour -> its name."""
MAX_VALUES = {0.25: "black", 0.8: "grey", 1.0: "white"}
"""Largest brightness of a colour without a hue -> its name."""
MIN_SATURATION = 0.3
COLOUR_NAMES = {*MAX_HUES_DEG.values(), *MAX_VALUES.values()}

type Templates = Mapping[str, Sequence[str]]
"""Sentences by level "1" to "3"; like a task's instructions they are filled with the words of the variation."""


def colour_name(rgb: ArrayLike) -> str:
    """The English name of a colour of three channels 0..1."""
    hue, saturation, value = colorsys.rgb_to_hsv(*np.asarray(rgb, float).tolist())
    if saturation >= MIN_SATURATION and value >= min(MAX_VALUES):
        return next(word for limit, word in MAX_HUES_DEG.items() if hue * 360 <= limit)
    return next(word for limit, word in MAX_VALUES.items() if value <= limit)


def named_colours(spec: TaskSpec) -> set[str]:
    """Colours that occur in any instruction of a task."""
    sentences = [sentence for row in spec.variations for sentence in spec.instructions_for(row)]
    return COLOUR_NAMES.intersection(re.findall("[a-z]+", " ".join(sentences).lower()))


@functools.cache
def paraphrases() -> Mapping[str, Templates]:
    """Task -> its other sentences, from `instruction.toml` beside this file; a task may have none."""
    return tomllib.loads(Path(__file__).with_name("instruction.toml").read_text(encoding="utf-8"))


def _has_paraphrases(task: TaskSpec, model: mujoco.MjSpec) -> bool:
    return task.name in paraphrases()


def _paraphrase(start: Start) -> None:
    """Draw one of the level's sentences."""
    templates = paraphrases()[start.task.spec.name][str(int(start.magnitude))]
    template = templates[int(start.rng.integers(len(templates)))]
    start.progress.instruction = template.format(**start.progress.variation.words)


register(Axis(**data("instruction"), applies_to=_has_paraphrases, begin=_paraphrase))
