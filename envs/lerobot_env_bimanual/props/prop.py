"""What a scene asks of a prop."""

from types import MappingProxyType
from typing import Protocol

from lerobot_env_bimanual.gl import mujoco

VISUAL_ONLY = MappingProxyType({"contype": 0, "conaffinity": 0, "mass": 0, "group": 2})
"""Settings of a geom that is seen but neither touches nor weighs anything."""

UNSEEN = MappingProxyType({"group": 3})
"""Settings of a geom that touches but is not drawn."""


class Prop(Protocol):
    """A thing in the scene: a small frozen dataclass of sizes that can write itself into a model."""

    @property
    def name(self) -> str:
        """Name of the prop's root body; prefix of its other names."""
        ...

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write bodies, geoms, joints, materials and contact pairs.

        The root body stands at the origin: tasks place it at reset. A prop that moves freely has a free joint.
        Props hold and are held by contact friction only: no welds, no mocap bodies.
        """
        ...
