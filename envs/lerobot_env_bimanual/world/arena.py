"""The empty room: physics options, table, floor, light and the fixed cameras."""

from collections.abc import Sequence

import numpy as np

from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.contact_layers import COMMON_LAYER, TABLE_ONLY
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, Prop
from lerobot_env_bimanual.robots.arm_pair import ArmPair
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS

PHYSICS_STEP_S = 0.002

FRICTION = (0.5, 0.005, 0.0001)
"""Sliding, m of torsion, m of rolling, of all that states none of its own; 0.5 slides in the original simulator, too.

Of two surfaces that touch the larger friction is at work, unless one has priority (the grippers' rubber), so a prop's
own value counts against table, arms and furniture where it is at least this.
"""

TABLE_CENTRE_XY_M = (0.27, 0.0)
TABLE_HALF_SIZE_M = (0.75, 0.65, 0.025)
LEG_RADIUS_M = 0.03
LEG_INSET_M = 0.08

# Finite for rendering: an endless plane alone costs as much as a third of an image.
FLOOR_HALF_SIZE_M = 5.0

KEY_LIGHT_POSITION_M = (-0.3, -1.7, 3.1)

NEAR_M = 0.01
FAR_M = 10.0


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
    spec.default.geom.friction = FRICTION


def _add_room(spec: mujoco.MjSpec) -> None:
    _set_depth_range(spec)
    _add_light(spec)
    world = spec.worldbody
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=(*TABLE_CENTRE_XY_M, 0),
        size=(FLOOR_HALF_SIZE_M, FLOOR_HALF_SIZE_M, 1),
        rgba=(0.60, 0.65, 0.70, 1),
    )
    _add_table(world)
    for camera in FIXED_CAMERAS:
        camera.add_to(world)


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
    spec.visual.map.shadowscale = (
        0.37  # of the key light's cone: just the table, in as many pixels as there are
    )
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
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.62, 0.74, 0.88),
        rgb2=(0.90, 0.93, 0.96),
        width=64,
        height=384,
    )


def _add_table(world) -> None:
    """A wooden board that props rest on, with legs for the eye only."""
    half_x, half_y, half_z = TABLE_HALF_SIZE_M
    centre_x, centre_y = TABLE_CENTRE_XY_M
    world.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=TABLE_HALF_SIZE_M,
        pos=(centre_x, centre_y, TABLE_HEIGHT_M - half_z),
        rgba=(0.86, 0.80, 0.70, 1),
        contype=COMMON_LAYER,
        conaffinity=COMMON_LAYER | TABLE_ONLY,
    )
    leg_height = TABLE_HEIGHT_M - 2 * half_z
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            world.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CYLINDER,
                size=(LEG_RADIUS_M, leg_height / 2, 0),
                pos=(
                    centre_x + side_x * (half_x - LEG_INSET_M),
                    centre_y + side_y * (half_y - LEG_INSET_M),
                    leg_height / 2,
                ),
                rgba=(0.35, 0.36, 0.38, 1),
                **VISUAL_ONLY,
            )
