"""The flat parts of trays: boards, handles and rims that hands pinch and things slide on."""

from lerobot_env_bimanual.gl import mujoco


def add_board(
    body: mujoco.MjsBody,
    position: tuple[float, float, float],
    half_size: tuple[float, float, float],
    rgba: tuple[float, ...],
    mass_kg: float,
    friction: float,
    name: str = "",
    group: int = 0,
) -> None:
    """Add a box whose contacts resist turning and are firm enough for a thin edge in a grip."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=position,
        size=half_size,
        rgba=rgba,
        mass=mass_kg,
        friction=(friction, 0.005, 0.0001),
        condim=4,
        solref=(0.006, 1),
        group=group,
    )
