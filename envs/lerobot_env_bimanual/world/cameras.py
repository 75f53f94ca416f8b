"""The fixed cameras, and the calibration of all five."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.scene_view import SceneView

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera axes (x right, y up, z backward) as columns in OpenCV's (x right, y down, z forward)."""


@dataclass(frozen=True)
class FixedCamera:
    """A camera that is fixed in the room.

    Attributes:
        name: one of `lerobot_bimanual.cameras.CAMERA_NAMES`.
        position: (3,) world, m.
        target: (3,) world point in the middle of the image, m.
        fovy_deg: vertical field of view.
    """

    name: str
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fovy_deg: float


# The arms stand on the x axis and look at each other; furniture stands on the far side (+y) and opens towards the near
# one and the left, drawers open towards the far one. So one camera looks from the near side, and one past each arm's
# shoulder from the far side, about 100, 130 and 130 degrees apart. Of some 100 places on a hemisphere these see most of
# what the experts' hands go to (docs/tasks.md), with the placement areas and, at home, both hands in every image.
FIXED_CAMERAS = (
    FixedCamera("front", (-0.23, -1.37, 1.75), (0.20, 0.00, 1.05), 43.0),
    FixedCamera("left_shoulder", (-0.77, 0.65, 2.13), (0.32, 0.04, 1.10), 44.5),
    FixedCamera("right_shoulder", (1.63, 0.38, 1.85), (0.19, -0.02, 1.04), 40.0),
)


def calibration(view: SceneView, height: int, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Calibration of the five cameras: where they are now, as far as known, and how they project.

    Args:
        view: the scene.
        height: of the images, pixels.
        width: of the images, pixels.

    Returns:
        Extrinsics (80,) float32: world_T_camera of every camera of `CAMERA_NAMES`, row-major 4x4, OpenCV axes.
        Intrinsics (45,) float32: their row-major 3x3 pinhole matrices in pixels.
    """
    extrinsics = np.zeros((len(CAMERA_NAMES), 4, 4))
    intrinsics = np.empty((len(CAMERA_NAMES), 3, 3))
    with applied(view.model, view.data, view.appearance.calibration):
        for index, name in enumerate(CAMERA_NAMES):
            camera = view.model.camera(name).id
            extrinsics[index, :3, :3] = view.data.cam_xmat[camera].reshape(3, 3) @ OPENCV_FROM_OPENGL
            extrinsics[index, :3, 3] = view.data.cam_xpos[camera]
            extrinsics[index, 3, 3] = 1
            intrinsics[index] = intrinsics_from_fovy(np.deg2rad(view.model.cam_fovy[camera]), height, width)
    return extrinsics.astype(np.float32).ravel(), intrinsics.astype(np.float32).ravel()
