"""What an episode's cameras hand out: observations, and frames for people."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.episode.observations import observe_images, observe_vectors
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbations.perturbations import Perturbations
from lerobot_env_bimanual.world.cameras import calibration
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene

FRAME_CAMERA = "front"
FRAME_SIZE = (480, 640)


class Sight:
    """The eyes of one environment; OpenGL starts at the first image.

    Args:
        scene: what is looked at.
        options: which cameras, and how.
        perturbations: what comes between a camera and those it shows its images to.
    """

    def __init__(self, scene: Scene, options: EnvOptions, perturbations: Perturbations):
        self._scene, self._options, self._perturbations = scene, options, perturbations
        self._cameras: Renderer | None = None
        self._film_camera: Renderer | None = None

    def observe(self, progress: EpisodeProgress) -> dict[str, Any]:
        """The observation of the present state; see `lerobot_env_bimanual.episode.observations` for its arrays."""
        images = {} if self._options.obs == "state" else self.images(progress, self._options.obs == "rgbd")
        views = calibration(self._scene, *self._options.size)
        return images | observe_vectors(self._scene, progress.keyposes, views)

    def images(self, progress: EpisodeProgress, depth: bool) -> dict[str, Any]:
        """The images of an observation, whatever `obs` says.

        Args:
            progress: of the episode.
            depth: with depth, or colours only.
        """
        if self._cameras is None:
            self._cameras = Renderer(self._scene, self._options.camera_names, *self._options.size)
        images = self._perturbations.see(self._cameras.render(), self._scene, progress)
        return observe_images(self._options.camera_names, images, depth)

    def frame(self) -> NDArray[np.uint8]:
        """The front camera at 480x640, uint8 RGB."""
        if self._film_camera is None:
            quality = self._options.render_quality
            self._film_camera = Renderer(self._scene, (FRAME_CAMERA,), *FRAME_SIZE, quality=quality)
        return self._film_camera.render()[FRAME_CAMERA][0]

    def close(self) -> None:
        """Free OpenGL."""
        for renderer in (self._cameras, self._film_camera):
            if renderer is not None:
                renderer.close()
        self._cameras = self._film_camera = None
