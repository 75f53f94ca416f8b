"""The protocol of props, and functions that add their bodies, joints, geoms and cameras.

Everything collides in the common layer of MuJoCo's bit masks `contype` and `conaffinity`. A prop may add geoms that touch
the table alone by giving them contype `TABLE_ONLY` and conaffinity 0, or dirt alone by `DIRT_ONLY`: dirt has that bit in
its conaffinity.
"""

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_env_bimanual.gl import mujoco

COMMON_LAYER = 1
TABLE_ONLY = 2
DIRT_ONLY = 4

VISUAL_ONLY = MappingProxyType({"contype": 0, "conaffinity": 0, "mass": 0, "group": 2})
"""Settings of a geom that is seen but neither touches nor weighs anything."""

HINGE, SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE

COLLISION_ONLY = MappingProxyType({"group": 3})
"""Settings of a geom that touches but is not drawn."""

COARSE, FINE = 1, 4
"""Groups of coarse visual geoms, which MuJoCo draws by default, and of fine ones for large pictures."""

ON_RUBBER = MappingProxyType({"stiffness": 1000.0, "damping": 20.0, "armature": 0.5})
"""Settings of the slide of a compliant handle, in N/m, N s/m and kg: with a rigid one, a hand beside the handle's arc would
strain its wrist. The added inertia keeps fingers from sinking into the handle."""

DISTRACTOR = "distractor"
"""Prefix of the names of bodies that no task uses, and no prop may have."""

type Vector = Sequence[float] | NDArray[np.float64]


class Prop(Protocol):
    """A thing in the scene: a small frozen dataclass of sizes that can write itself into a model."""

    @property
    def name(self) -> str:
        """Name of the prop's root body; prefix of its other names."""
        ...

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write bodies, geoms, joints, materials and contact pairs.

        The root body is at the origin: tasks place it at reset. A prop that moves freely has a free joint.
        Props hold and are held by contact friction only: no welds, no mocap bodies.
        """
        ...


def add_free_body(spec: mujoco.MjSpec, name: str) -> mujoco.MjsBody:
    """Add a body that moves freely, at the origin."""
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint()
    return body


def add_joint(
    body: mujoco.MjsBody,
    kind: mujoco.mjtJoint,
    name: str,
    axis: Vector,
    limits: Vector,
    friction: float = 0.0,
    damping: float = 0.0,
    **settings: Any,
) -> None:
    """Add a hinge or slide to a body, with its limits in rad or m, and friction and damping in N m, N m s, N or N s/m."""
    limited = {"type": kind, "axis": axis, "range": limits}
    body.add_joint(name=name, frictionloss=friction, damping=damping, **limited, **settings)


def graspable(friction: float) -> dict[str, Any]:
    """Settings of a geom whose contacts resist turning and are firm enough for a thin edge in a grip."""
    return {"friction": (friction, 0.005, 0.0001), "condim": 4, "solref": (0.006, 1)}


def add_box(body: mujoco.MjsBody, position: Vector, half_size: Vector, **settings: Any) -> mujoco.MjsGeom:
    """Add a box to a body, by its centre and half sizes in m; `settings` are those of MuJoCo's geoms."""
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=position, size=half_size, **settings)


def add_visual_box(body: mujoco.MjsBody, position: Vector, half_size: Vector, **settings: Any) -> None:
    """Add a box that is seen but neither touches nor weighs anything, as in `add_box`."""
    add_box(body, position, half_size, **settings, **VISUAL_ONLY)


def add_cylinder(
    body: mujoco.MjsBody, position: Vector, radius: float, half_height: float, **settings: Any
) -> mujoco.MjsGeom:
    """Add a cylinder to a body, by its centre, radius and half height in m."""
    size = (radius, half_height, 0)
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, pos=position, size=size, **settings)


def add_sphere(body: mujoco.MjsBody, position: Vector, radius: float, **settings: Any) -> mujoco.MjsGeom:
    """Add a ball to a body, by its centre and radius in m."""
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=position, size=(radius, 0, 0), **settings)


def add_camera(
    body: mujoco.MjsBody, name: str, position: Vector, target: Vector, fovy_deg: float, up: Vector
) -> None:
    """Add a camera to a body.

    Args:
        body: it is fixed to.
        name: its name.
        position: (3,) m.
        target: (3,) the point in the middle of the image, m.
        fovy_deg: vertical field of view.
        up: (3,) direction whose component perpendicular to the optical axis points up in the image.
    """
    quat = matrix_to_quat_wxyz(camera_axes(np.subtract(position, target), up))
    body.add_camera(name=name, pos=position, quat=quat, fovy=fovy_deg)


def camera_axes(backward: Vector, up: Vector) -> NDArray[np.float64]:
    """Axes (3, 3) of a camera, in MuJoCo's order, that looks away from a direction (3,); `up` as in `add_camera`."""
    backward = np.divide(backward, np.linalg.norm(backward))  # MuJoCo cameras look along -z
    right = np.cross(up, backward)
    right = right / np.linalg.norm(right)
    return np.column_stack([right, np.cross(backward, right), backward])


def add_capsule(body: mujoco.MjsBody, ends: Vector, radius: float, **settings: Any) -> mujoco.MjsGeom:
    """Add a capsule to a body, by the middles of its two caps (6,) and its radius in m."""
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, size=(radius, 0, 0), **settings)
