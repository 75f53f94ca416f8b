"""Names of every dataset feature, and the elements of what is observed: the only place where they are spelled.

The environment emits the same observation keys, so a policy trained on the dataset sees the same batch in
`lerobot-eval`. All vectors are flat, because LeRobot cannot merge datasets with multi-dimensional columns.
"""

from pathlib import Path
from typing import Literal

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.cameras import CAMERA_NAMES, WRIST_CAMERA_NAMES

SCHEMA_VERSION = 3
VERSION_INFO = "bimanual_schema_version"
"""Where the version is stored: in the `info` of the feature `TASK_NAME`, which LeRobot keeps when it merges."""

ROBOT_TYPE = "bimanual_panda"

View = Literal["frames", "keyframes"]
VIEWS: tuple[View, ...] = ("frames", "keyframes")

PROVENANCE_FILE = Path("meta", "bimanual.json")
"""What a dataset was made from, beside LeRobot's own metadata."""

CALIBRATION_INFO = "bimanual_calibration"
"""Where the calibration of all rows is stored: in the `info` of the feature `WRIST_EXTRINSICS`."""

DEPTH_MIN_M = 0.01
DEPTH_MAX_M = 4.0
"""Depth range; beyond it depth is clipped. 12 bits over it are steps of 0.974 mm: whole millimetres survive."""

MM_PER_M = 1000

UNMEASURED_MM = DEPTH_MIN_M * MM_PER_M + 0.5
"""Depth up to this value means not measured. An environment gives 0; a dataset, whose codec has no 0, stores the lower end
of the range. No surface is as near, because the near planes of all cameras are there."""

IMAGE_PREFIX = "observation.images."
CAMERA_EXTRINSICS = "observation.camera_extrinsics"
WRIST_EXTRINSICS = "observation.wrist_extrinsics"
"""world_T_camera of the wrist cameras alone, where a dataset's metadata hold the others. The name differs from that of
`CAMERA_EXTRINSICS`, under which an environment emits all five, because LeRobot's processors match names to statistics."""
CAMERA_INTRINSICS = "observation.camera_intrinsics"
STATE = "observation.state"
EE_POSE = "observation.ee_pose"
GRIPPER_FINGERS = "observation.gripper_fingers"
KEYPOSE_STEP = "observation.keypose_step"
ACTION = "action"
KEYFRAME = "keyframe"
TICK = "tick"
TIME = "time_s"
STATE_HASH = "state_hash"
TASK_NAME = "task_name"
SPLIT = "split"
VARIATION = "variation"
SEED = "seed"

JOINT_NAMES = tuple(
    f"{arm}_{name}.pos"
    for arm in ARMS
    for name in (*(f"joint{i + 1}" for i in range(JOINTS_PER_ARM)), "gripper")
)
"""Layout of `observation.state` and of joint actions: per arm seven joints in radians and the opening 0..1.

LeRobot's rollout and replay know positions by the ending `.pos`.
"""

POSE_NAMES = tuple(f"{arm}_{name}" for arm in ARMS for name in ("x", "y", "z", "qw", "qx", "qy", "qz"))
FINGER_NAMES = tuple(f"{arm}_finger{i}" for arm in ARMS for i in (1, 2))
EXTRINSIC_NAMES = tuple(f"{camera}_T{r}{c}" for camera in CAMERA_NAMES for r in range(4) for c in range(4))
WRIST_EXTRINSIC_NAMES = tuple(name for name in EXTRINSIC_NAMES if name.startswith(WRIST_CAMERA_NAMES))
INTRINSIC_NAMES = tuple(f"{camera}_K{r}{c}" for camera in CAMERA_NAMES for r in range(3) for c in range(3))

VECTORS: dict[str, tuple[str, ...]] = {
    STATE: JOINT_NAMES,
    EE_POSE: POSE_NAMES,
    GRIPPER_FINGERS: FINGER_NAMES,
    KEYPOSE_STEP: ("keyposes_completed",),
    CAMERA_EXTRINSICS: EXTRINSIC_NAMES,
    CAMERA_INTRINSICS: INTRINSIC_NAMES,
}
"""float32 columns of what is observed, and the name of each element."""


def image_key(camera: str) -> str:
    """Key of a camera's RGB image, uint8 (height, width, 3)."""
    return f"{IMAGE_PREFIX}{camera}"


def depth_key(camera: str) -> str:
    """Key of a camera's depth image, millimetres along the optical axis."""
    return f"{IMAGE_PREFIX}{camera}_depth"


def state_hash_column(hexdigest: str) -> int:
    """First 64 bits of a state hash as the signed integer that `STATE_HASH` stores."""
    return int.from_bytes(bytes.fromhex(hexdigest[:16]), "big", signed=True)
