"""A thing that an MJCF file describes."""

from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import COARSE, COLLISION_ONLY, FINE


@dataclass(frozen=True)
class ModelFile:
    """The first body of an MJCF file, with its meshes, materials and joints; names there are prefixed by `name_`.

    Attributes:
        name: of the body in the scene.
        path: of the file; it says in which folder meshes are.
        is_free: whether a body without joints moves freely; false for one that stays where it is placed, such as furniture.
    """

    name: str
    path: str | Path
    is_free: bool = True

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Attach the body at the origin; its visible geoms are drawn in images of all sizes."""
        try:
            body = mujoco.MjSpec.from_file(str(self.path)).worldbody.first_body()
        except ValueError as error:
            raise BimanualError(f"prop {self.name!r}: {Path(self.path).absolute()}: {error}") from error
        if body is None:
            raise BimanualError(
                f"prop {self.name!r}: {self.path} has no body: put what it describes into one"
            )
        attached = spec.worldbody.add_frame().attach_body(body, f"{self.name}_", "")
        old, attached.name = attached.name, self.name
        for each in spec.excludes:  # these name bodies, and a new name does not reach them
            each.bodyname1, each.bodyname2 = (
                self.name if name == old else name for name in (each.bodyname1, each.bodyname2)
            )
        for each in spec.equalities:
            if each.objtype == mujoco.mjtObj.mjOBJ_BODY:
                each.name1, each.name2 = (
                    self.name if name == old else name for name in (each.name1, each.name2)
                )
        attached.pos, attached.quat = (0, 0, 0), (1, 0, 0, 0)
        for each in (attached, *attached.find_all("body")):
            for geom in each.geoms:
                geom.group = {COARSE: 0, FINE: COLLISION_ONLY["group"]}.get(geom.group, geom.group)
        if self.is_free and not attached.joints:
            attached.add_freejoint()
