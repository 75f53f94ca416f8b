"""Observations: the arrays that a step returns, and the cameras that make their images.

Keys follow from the dataset schema, so that LeRobot's `preprocess_observation` turns each into the dataset's
key of the same meaning: `pixels[camera]` and `agent_pos` have the names LeRobot expects, every other key is the
dataset's without its prefix `observation.`. All arrays are fresh copies.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

PIXELS = "pixels"
FRAME_CAMERA = "front"
FRAME_SIZE = (480, 640)
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera axes (x right, y up, z backward) as columns in OpenCV's (x right, y down, z forward)."""

type Images = Mapping[str, tuple[NDArray[np.uint8], NDArray[np.float32]]]
"""Camera -> RGB (H, W, 3) and depth (H, W) in metres along the optical axis, 0 where none was measured."""
type Filter = Callable[[Images, Scene, EpisodeProgress], Images]
"""Changes images between the cameras and the observation, as perturbations do."""

_BOUNDS = {
    schema.STATE: (-2 * np.pi, 2 * np.pi),
    schema.EE_POSE: (-5.0, 5.0),
    schema.GRIPPER_FINGERS: (-0.1, 0.1),
    schema.KEYPOSE_STEP: (0.0, 1e6),
    schema.CAMERA_EXTRINSICS: (-10.0, 10.0),
    schema.CAMERA_INTRINSICS: (0.0, 1e5),
}
"""Vectors of an observation with loose bounds of their elements (m, rad, pixels)."""


def env_key(dataset_key: str) -> str:
    """Key of a vector or a depth image in the environment's observation."""
    return "agent_pos" if dataset_key == schema.STATE else dataset_key.removeprefix("observation.")


def dataset_key(key: str) -> str:
    """Key in a dataset, and in a policy's batch, of what an environment calls `key`."""
    if key == schema.ACTION or key.startswith("observation."):
        return key
    return schema.STATE if key == "agent_pos" else f"observation.{key}"


def dataset_row(observation: Mapping[str, Any]) -> dict[str, Any]:
    """An observation with the keys of a `LeRobotDataset`, and colours as float32 (3, H, W) in [0, 1]."""
    vectors = dict(observation)
    colours = {
        schema.image_key(camera): np.ascontiguousarray(np.moveaxis(rgb, -1, 0), np.float32) / 255
        for camera, rgb in vectors.pop(PIXELS, {}).items()
    }
    return colours | {dataset_key(key): value for key, value in vectors.items()}


def observation_space(options: EnvOptions) -> spaces.Dict:
    """Space of the observations that `observe` returns."""
    size = options.size
    space: dict[str, spaces.Space[Any]] = {}
    if options.obs != "state":
        image = spaces.Box(0, 255, (*size, 3), np.uint8)
        space[PIXELS] = spaces.Dict(dict.fromkeys(options.camera_names, image))
    if options.obs == "rgbd":
        depth = spaces.Box(0, schema.DEPTH_MAX_M * schema.MM_PER_M, (1, *size), np.float32)
        space |= {env_key(schema.depth_key(camera)): depth for camera in options.camera_names}
    for key, (low, high) in _BOUNDS.items():
        space[env_key(key)] = spaces.Box(low, high, (len(schema.VECTORS[key]),), np.float32)
    return spaces.Dict(space)


class ObservationRenderer:
    """Makes the observations of one environment, and frames for videos; OpenGL starts at the first image.

    The filter `change` applies to observed images, not to frames.
    """

    def __init__(self, scene: Scene, options: EnvOptions, change: Filter):
        self._scene, self._options, self._change = scene, options, change
        self._cameras: Renderer | None = None
        self._frame_camera: Renderer | None = None

    def observe(self, progress: EpisodeProgress) -> dict[str, Any]:
        """The observation of the present state; the module's docstring says which arrays it has."""
        images = {} if self._options.obs == "state" else self.images(progress, self._options.obs == "rgbd")
        return images | self._vectors(progress.keyposes)

    def images(self, progress: EpisodeProgress, depth: bool) -> dict[str, Any]:
        """The images of an observation, whatever `obs` says.

        Returns:
            `pixels`, and with depth `images.<camera>_depth` float32 (1, H, W) in millimetres, LeRobot's unit, clipped to
            the range that datasets store, and 0 where none was measured.
        """
        cameras = self._options.camera_names
        if self._cameras is None:
            self._cameras = Renderer(self._scene, cameras, *self._options.size)
        images = self._change(self._cameras.render(), self._scene, progress)
        observation: dict[str, Any] = {PIXELS: {camera: images[camera][0] for camera in cameras}}
        if depth:
            for camera in cameras:
                depth_mm = np.minimum(images[camera][1], schema.DEPTH_MAX_M)  # at least the near plane, or 0
                depth_mm *= schema.MM_PER_M
                observation[env_key(schema.depth_key(camera))] = depth_mm[None]
        return observation

    def _vectors(self, keyposes: int) -> dict[str, NDArray[np.float32]]:
        """The vectors of an observation after so many keyposes; calibration is that of all five cameras."""
        view = self._scene
        extrinsics, intrinsics = calibration(view, *self._options.size)
        tcps = [view.tcp(arm) for arm in ARMS]
        positions = np.stack([tcp.position for tcp in tcps])  # (2, 3)
        quaternions = quat_wxyz_canonical(np.stack([tcp.quat_wxyz for tcp in tcps]))  # (2, 4)
        state = [[*view.joint_positions(arm), view.gripper_opening(arm)] for arm in ARMS]
        vectors = {
            schema.STATE: np.concatenate(state),
            schema.EE_POSE: np.concatenate([positions, quaternions], axis=1).ravel(),
            schema.GRIPPER_FINGERS: np.concatenate([view.finger_positions(arm) for arm in ARMS]),
            schema.KEYPOSE_STEP: np.array([keyposes]),
            schema.CAMERA_EXTRINSICS: extrinsics,
            schema.CAMERA_INTRINSICS: intrinsics,
        }
        return {env_key(key): vector.astype(np.float32) for key, vector in vectors.items()}

    def frame(self) -> NDArray[np.uint8]:
        """The front camera at 480x640, uint8 RGB."""
        if self._frame_camera is None:
            quality = self._options.render_quality
            self._frame_camera = Renderer(self._scene, (FRAME_CAMERA,), *FRAME_SIZE, quality=quality)
        return self._frame_camera.render()[FRAME_CAMERA][0]

    def close(self) -> None:
        """Free OpenGL."""
        for renderer in (self._cameras, self._frame_camera):
            if renderer is not None:
                renderer.close()
        self._cameras = self._frame_camera = None


def calibration(view: SceneView, height: int, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Calibration of the five cameras: where they are now, as far as known, and how they project.

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
