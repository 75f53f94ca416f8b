"""The empty room: physics options, table, floor, light and the fixed cameras."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.robots.arm_pair import ArmPair

PHYSICS_STEP_S = 0.002

TABLE_CENTRE_XY_M = (0.27, 0.0)
TABLE_HALF_SIZE_M = (0.75, 0.65, 0.025)

# Contact layers (bit masks). Everything collides in the common layer; props may add geoms that touch the table
# alone by giving them contype TABLE_ONLY and conaffinity 0.
COMMON_LAYER = 1
TABLE_ONLY = 2


@dataclass(frozen=True)
class FixedCamera:
    """A camera that stands in the room.

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


FIXED_CAMERAS = (
    FixedCamera("front", (0.27, 1.35, 1.55), (0.25, 0.0, 0.90), 50.0),
    FixedCamera("left_shoulder", (-0.55, 0.75, 1.75), (0.30, -0.05, 0.85), 55.0),
    FixedCamera("right_shoulder", (1.10, -0.95, 1.75), (0.25, 0.05, 0.85), 55.0),
)


def build_spec(props: Sequence[Prop], arm_pair: ArmPair) -> mujoco.MjSpec:
    """A complete model: room, arms, then props in the given order."""
    spec = mujoco.MjSpec()
    spec.modelname = "bimanual"
    spec.compiler.degree = False
    spec.memory = 32 * 2**20
    _set_physics(spec)
    _add_room(spec)
    arm_pair.add_to(spec)
    for prop in props:
        prop.add_to(spec)
    return spec


def _set_physics(spec: mujoco.MjSpec) -> None:
    """Settings under which a grasp neither creeps nor drops: an elliptic cone with stiff friction."""
    spec.option.timestep = PHYSICS_STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10


def _add_room(spec: mujoco.MjSpec) -> None:
    spec.visual.map.znear = 0.01
    spec.visual.map.zfar = 10
    spec.visual.headlight.ambient = (0.35, 0.35, 0.35)
    spec.visual.headlight.diffuse = (0.35, 0.35, 0.35)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.9, 0.93, 0.97),
        rgb2=(0.5, 0.55, 0.6),
        width=64,
        height=384,
    )
    world = spec.worldbody
    world.add_light(pos=(0.2, 0.2, 3), dir=(0, 0, -1), diffuse=(0.5, 0.5, 0.5), castshadow=True)
    world.add_light(pos=(-1, -1, 2.5), dir=(0.5, 0.5, -1), diffuse=(0.5, 0.5, 0.5), castshadow=False)
    world.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(3, 3, 0.1), rgba=(0.55, 0.57, 0.6, 1)
    )
    world.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=TABLE_HALF_SIZE_M,
        pos=(*TABLE_CENTRE_XY_M, TABLE_HEIGHT_M - TABLE_HALF_SIZE_M[2]),
        rgba=(0.72, 0.66, 0.58, 1),
        contype=COMMON_LAYER,
        conaffinity=COMMON_LAYER | TABLE_ONLY,
    )
    for camera in FIXED_CAMERAS:
        _add_camera(world, camera)


def _add_camera(world, camera: FixedCamera) -> None:
    backward = np.subtract(camera.position, camera.target)  # MuJoCo cameras look along -z
    backward = backward / np.linalg.norm(backward)
    right = np.cross((0, 0, 1), backward)
    right = right / np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(backward, right), backward])
    world.add_camera(
        name=camera.name,
        pos=camera.position,
        quat=matrix_to_quat_wxyz(rotation),
        fovy=camera.fovy_deg,
    )
