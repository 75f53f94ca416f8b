"""What is seen of arms and room: shells near what collides, textures that are the same everywhere."""

import hashlib

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.textures import boards, plaster

MAX_DISTANCE_M = 0.02


def distance_m(model, data, geom: int, points: np.ndarray) -> np.ndarray:
    """Of points (n, 3) from the surface of a capsule, cylinder or box; negative inside."""
    local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        local[:, 2] -= np.clip(local[:, 2], -size[1], size[1])
        return np.linalg.norm(local, axis=1) - size[0]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        over = np.column_stack([np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])]) - size[:2]
    else:
        assert kind == mujoco.mjtGeom.mjGEOM_BOX
        over = np.abs(local) - size
    return np.minimum(over.max(axis=1), 0) + np.linalg.norm(np.maximum(over, 0), axis=1)


def test_an_arm_s_shells_stand_out_of_what_collides_by_two_centimetres_at_most(scene):
    model, data = scene.model, scene.data
    collides = model.geom_contype != 0
    shells = np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~collides)
    assert len(shells) > 30
    for shell in shells:
        body = model.geom_bodyid[shell]
        mesh = model.geom_dataid[shell]
        first = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        corners = data.geom_xpos[shell] + corners @ data.geom_xmat[shell].reshape(3, 3).T
        # At a joint the housing belongs to one link or the other.
        kin = np.flatnonzero((model.body_parentid == body) | (np.arange(model.nbody) == body))
        kin = np.append(kin, model.body_parentid[body])
        near = np.flatnonzero(collides & np.isin(model.geom_bodyid, kin[kin > 0]))
        away = np.min([distance_m(model, data, geom, corners) for geom in near], axis=0)
        assert away.max() < MAX_DISTANCE_M, f"{model.body(body).name} looks larger than it is"


def test_textures_are_the_same_pixels_on_every_machine():
    wood = boards((0.8, 0.7, 0.6), (40, 64), count=4, joints=2, seed=5)
    wall = plaster((0.6, 0.7, 0.7), (32, 48), skirting=3, seed=5)
    assert (wood.dtype, wood.shape, wall.shape) == (np.uint8, (40, 64, 3), (32, 48, 3))
    assert hashlib.sha256(wood.tobytes() + wall.tobytes()).hexdigest()[:16] == "89b0316a1eb822ac"
