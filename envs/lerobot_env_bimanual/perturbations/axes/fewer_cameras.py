"""Some cameras show nothing."""

import numpy as np

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group, Image
from lerobot_env_bimanual.perturbations.registry import register

KEPT, *OTHERS = CAMERA_NAMES


@register
class FewerCameras(Axis):
    """The first camera, `front`, stays: a policy that sees nothing at all refuses to act."""

    name = "fewer_cameras"
    group = Group.SEEN
    levels = (1, 2, 3)
    unit = "cameras of five"
    summary = f"cameras, drawn for the episode from all but {KEPT}, hand out black images without depth"
    source = "chosen here: cables and drivers fail one camera at a time"

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Draw in which order cameras fail."""
        start.progress.memory[self.name] = rng.permutation(OTHERS).tolist()[: int(magnitude)]

    def see(
        self,
        camera: str,
        image: Image,
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> Image:
        """Nothing, or what the camera sees."""
        if camera in progress.memory[self.name]:
            for values in image:
                values[:] = 0
        return image
