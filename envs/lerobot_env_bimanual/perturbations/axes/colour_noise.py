"""Colours are noisy, and exposed otherwise."""

import numpy as np

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axes._noise import normal
from lerobot_env_bimanual.perturbations.axis import Axis, Group, Image
from lerobot_env_bimanual.perturbations.registry import register

GAMMA = 2.2
"""Between light and the numbers that stand for it."""
SIGMA_PER_STOP = 12
"""Noise, of 255 grey values."""

FRACTIONS = 64
"""Of a grey value, in which is counted: with 16 bits, which are fast."""


@register
class ColourNoise(Axis):
    """Each camera is exposed on its own for a whole episode; the noise is new in every image."""

    name = "colour_noise"
    group = Group.SEEN
    levels = (0.25, 0.5, 1.0)
    unit = "stops of exposure, with noise of 12 grey values (of 255) a stop"
    summary = "each camera is exposed too long or too short, and every pixel is noisy; depth stays as it is"
    source = (
        "chosen here: an automatic exposure is off by a third of a stop to one, and raises the gain with it"
    )

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Draw which cameras are exposed too long (1), and which too short (-1)."""
        signs = rng.choice((-1, 1), size=len(CAMERA_NAMES))
        start.progress.memory[self.name] = dict(zip(CAMERA_NAMES, signs.tolist(), strict=True))

    def see(
        self,
        camera: str,
        image: Image,
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> Image:
        """Expose, and add noise."""
        rgb, depth_m = image
        gain = 2 ** (progress.memory[self.name][camera] * magnitude / GAMMA)
        values = rgb.astype(np.int16)
        values *= round(gain * FRACTIONS)
        values += normal(rgb.shape, SIGMA_PER_STOP * magnitude * FRACTIONS, rng, np.int16)
        np.clip(values, 0, FRACTIONS * 256 - 1, out=values)
        greys = values.view(np.uint16)  # by which NumPy divides twice as fast
        greys //= FRACTIONS
        return greys.astype(np.uint8), depth_m
