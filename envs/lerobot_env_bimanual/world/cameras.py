"""The fixed cameras, and the calibration of all five."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.scene_view import SceneView

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera axes (x right, y up, z backward) as columns in OpenCV's (x right, y down, z forward)."""


# The arms stand on the x axis and look at each other; furniture stands on the far side (+y) and opens towards the near
# one and the left, drawers open towards the far one. The front camera looks from the near side and shows both hands at
# home. The other two look past the arms' shoulders at the table alone, so that things on it are larger: the left one from
# the far side, low, and the right one from the near side, high, which keeps the backs of furniture out of the way. Of some
# 200 places on a hemisphere these show most of what the experts' hands go to.
FIXED_CAMERAS = {
    "front": ((-0.60, -1.52, 1.65), (0.29, -0.04, 1.04), 38.0),
    "left_shoulder": ((-0.70, 0.93, 1.48), (0.24, 0.03, 0.80), 44.0),
    "right_shoulder": ((0.80, -0.97, 2.41), (0.25, -0.06, 0.84), 32.5),
}
"""Where each camera of the room is, the point in the middle of its image, both (3,) m in the world, and its vertical field of view
in degrees."""


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
