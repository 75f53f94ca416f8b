"""The empty room: physics options, table, floor, light and the fixed cameras."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.textures import add_material, boards, plaster

PHYSICS_STEP_S = 0.002

FRICTION = (0.5, 0.005, 0.0001)
"""Default friction: sliding, torsional (m) and rolling (m). The original simulator's sliding friction is 0.5, too.

MuJoCo uses the larger friction of two geoms in contact, unless one has priority (the grippers' rubber). So a prop's
own value counts against table, arms and furniture if it is at least this.
"""

TABLE_CENTRE_XY_M = (0.27, 0.0)
TABLE_HALF_SIZE_M = (0.75, 0.65, 0.025)
LEG_HALF_SIDE_M = 0.03
LEG_INSET_M = 0.08

ROOM_HALF_SIDE_M = 2.6
ROOM_HEIGHT_M = 3.2
MAPLE = (0.88, 0.79, 0.66)
OAK_GREY = (0.50, 0.47, 0.44)
PAINT = (0.58, 0.66, 0.68)
CEILING = (0.92, 0.92, 0.90, 1)
LEG_GREY = (0.35, 0.36, 0.38, 1)

KEY_LIGHT_POSITION_M = (-0.3, -1.7, 3.1)

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

NEAR_M = 0.01
FAR_M = 10.0


def build_spec(props: Sequence[prop.Prop]) -> mujoco.MjSpec:
    """A complete model: room, arms, then props in the given order."""
    spec = mujoco.MjSpec()
    spec.modelname = "bimanual"
    spec.compiler.degree = False
    spec.memory = 32 * 2**20
    _set_physics(spec)
    _add_room(spec)
    PANDA_PAIR.add_to(spec)
    for each in props:
        each.add_to(spec)
    return spec


def _set_physics(spec: mujoco.MjSpec) -> None:
    """Settings under which a grasp neither creeps nor drops: an elliptic cone with stiff friction."""
    spec.option.timestep = PHYSICS_STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10
    spec.default.geom.friction = FRICTION


def _add_room(spec: mujoco.MjSpec) -> None:
    _set_depth_range(spec)
    _add_light(spec)
    _add_walls(spec)
    _add_table(spec)
    for name, (position, target, fovy_deg) in FIXED_CAMERAS.items():
        prop.add_camera(spec.worldbody, name, position, target, fovy_deg, up=(0, 0, 1))


def _add_walls(spec: mujoco.MjSpec) -> None:
    """Floor, four painted walls and a ceiling; only the floor is touched."""
    add_material(spec, "floor", boards(OAK_GREY, (256, 256), count=8, joints=2, seed=1), repeat=(3, 3))
    add_material(spec, "wall", plaster(PAINT, (160, 256), skirting=5, seed=2))
    world = spec.worldbody
    x, y = TABLE_CENTRE_XY_M
    plane, side, half_height = mujoco.mjtGeom.mjGEOM_PLANE, ROOM_HALF_SIDE_M, ROOM_HEIGHT_M / 2
    # A plane's size is only that of its image; for collisions it is infinite.
    world.add_geom(name="floor", type=plane, pos=(x, y, 0), size=(side, side, 1), material="floor")
    ceiling = {"pos": (x, y, ROOM_HEIGHT_M), "quat": (0, 1, 0, 0), "rgba": CEILING}
    world.add_geom(type=plane, size=(side, side, 1), **ceiling, **prop.VISUAL_ONLY)
    for yaw_rad in np.arange(4) * np.pi / 2:
        inward = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0])
        rotation = np.column_stack([np.cross((0, 0, 1), inward), (0, 0, 1), inward])
        wall = {"pos": (x, y, half_height) - side * inward, "quat": matrix_to_quat_wxyz(rotation)}
        world.add_geom(type=plane, size=(side, half_height, 1), material="wall", **wall, **prop.VISUAL_ONLY)


def _set_depth_range(spec: mujoco.MjSpec) -> None:
    """Near and far plane in metres (an extent of 1 m makes them so), the same for every set of props."""
    spec.stat.extent = 1.0
    spec.stat.center = (*TABLE_CENTRE_XY_M, TABLE_HEIGHT_M)
    spec.visual.map.znear = NEAR_M
    spec.visual.map.zfar = FAR_M


def _add_light(spec: mujoco.MjSpec) -> None:
    """Soft daylight: even ambient light, a key light that casts shadows, a weaker fill light."""
    # The headlight only brightens evenly: a light that moved with the camera would make an image depend on which
    # other cameras are rendered with it.
    spec.visual.headlight.ambient = (0.48, 0.48, 0.49)
    spec.visual.headlight.diffuse = (0, 0, 0)
    spec.visual.headlight.specular = (0, 0, 0)
    # Of the key light's cone: just the table, in as many pixels as there are.
    spec.visual.map.shadowscale = 0.37
    world = spec.worldbody
    world.add_light(
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        pos=KEY_LIGHT_POSITION_M,
        dir=np.subtract((*TABLE_CENTRE_XY_M, TABLE_HEIGHT_M), KEY_LIGHT_POSITION_M),
        cutoff=85,
        exponent=0,
        diffuse=(0.50, 0.50, 0.49),
        specular=(0.15, 0.15, 0.15),
        castshadow=True,
    )
    world.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=(-0.6, -0.7, -0.6),
        diffuse=(0.22, 0.22, 0.23),
        specular=(0, 0, 0),
        castshadow=False,
    )


def _add_table(spec: mujoco.MjSpec) -> None:
    """A wooden board that props rest on, with legs for the eye only."""
    add_material(spec, "table", boards(MAPLE, (480, 512), count=10, joints=0, seed=3))
    world = spec.worldbody
    half_x, half_y, half_z = TABLE_HALF_SIZE_M
    centre_x, centre_y = TABLE_CENTRE_XY_M
    middle = (centre_x, centre_y, TABLE_HEIGHT_M - half_z)
    layers = {"contype": prop.COMMON_LAYER, "conaffinity": prop.COMMON_LAYER | prop.TABLE_ONLY}
    prop.add_box(world, middle, TABLE_HALF_SIZE_M, name="table", material="table", **layers)
    leg_height = TABLE_HEIGHT_M - 2 * half_z
    leg = (LEG_HALF_SIDE_M, LEG_HALF_SIDE_M, leg_height / 2)
    for side_x, side_y in product((-1, 1), repeat=2):
        x, y = centre_x + side_x * (half_x - LEG_INSET_M), centre_y + side_y * (half_y - LEG_INSET_M)
        prop.add_visual_box(world, (x, y, leg_height / 2), leg, rgba=LEG_GREY)
