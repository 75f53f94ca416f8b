"""What colours are called in instructions."""

import colorsys
import re

import numpy as np
from numpy.typing import ArrayLike

from lerobot_env_bimanual.task import TaskSpec

HUES_DEG = {
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
"""Up to which hue a colour has which name."""
GREYS = {0.25: "black", 0.8: "grey", 1.0: "white"}
"""Up to which brightness a colour without a hue has which name."""
LEAST_SATURATION = 0.3

WORDS = {*HUES_DEG.values(), *GREYS.values()}


def called(rgb: ArrayLike) -> str:
    """What a colour of three channels 0..1 is called."""
    hue, saturation, value = colorsys.rgb_to_hsv(*np.asarray(rgb, float).tolist())
    if saturation >= LEAST_SATURATION and value >= min(GREYS):
        return next(word for limit, word in HUES_DEG.items() if hue * 360 <= limit)
    return next(word for limit, word in GREYS.items() if value <= limit)


def named_colours(spec: TaskSpec) -> set[str]:
    """Colours that occur in any instruction of a task."""
    sentences = [sentence for row in spec.variations for sentence in spec.instructions_for(row)]
    return WORDS.intersection(re.findall("[a-z]+", " ".join(sentences).lower()))
