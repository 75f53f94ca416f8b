"""Net forces between each arm and everything else that it touches, and how deep bodies penetrate each other."""

import math

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene_view import SceneView

FORCE_FILTER_HZ = 10.0
"""Bandwidth of the low-pass filter of an arm's forces: its response to a step reaches 63 % after 16 ms."""
AT_REST_N = np.zeros((len(ARMS), 3))


class ContactForces:
    """Collects forces and penetrations of a scene's contacts at each step of physics until `take` returns them; read-only."""

    def __init__(self, scene: SceneView):
        self._scene = scene
        self._arm_of_geom = scene.arm_of_body[scene.model.geom_bodyid]
        self._forces_n: list[NDArray[np.float64]] = []
        self._deepest = 0.0, ""

    def note(self) -> None:
        """Note a step of physics, right after it, while its forces are known."""
        forces_n, data = AT_REST_N.copy(), self._scene.data
        self._forces_n.append(forces_n)
        if not data.ncon:
            return
        contact = data.contact
        geoms, rows = contact.geom, contact.efc_address
        deepest = contact.dist.argmin()
        if (depth_m := -float(contact.dist[deepest])) > self._deepest[0]:
            model = self._scene.model
            bodies = model.geom_bodyid[geoms[deepest]]
            self._deepest = depth_m, ", ".join(model.body(body).name for body in bodies)
        arms = self._arm_of_geom[geoms]
        # Leave out contacts without an arm, or of an arm with itself.
        outside = np.flatnonzero((arms[:, 0] != arms[:, 1]) & (rows >= 0))
        if not len(outside):
            return
        # With elliptic cones a contact's first rows are its force along its axes; without friction it has one alone.
        components = np.arange(3) * (contact.dim[outside, None] > 1)
        local_n = data.efc_force[rows[outside, None] + components] * (components == np.arange(3))
        on_second_n = np.einsum("ni,nij->nj", local_n, contact.frame[outside].reshape(-1, 3, 3))
        for side, sign in ((0, -1), (1, 1)):
            touched = arms[outside, side]
            on_arm = touched >= 0
            np.add.at(forces_n, touched[on_arm], sign * on_second_n[on_arm])

    def take(self) -> tuple[NDArray[np.float64], float, str]:
        """Return what was noted since the last call.

        Returns:
            (steps, 2, 3) net forces on each arm in N, world frame; the deepest penetration in m, and the two bodies, 0 and
            "" if there is none. The squeezing forces of a hand's two fingers cancel out.
        """
        forces_n, (depth_m, bodies) = self._forces_n, self._deepest
        self._forces_n, self._deepest = [], (0.0, "")
        return np.array(forces_n).reshape(-1, *AT_REST_N.shape), depth_m, bodies


def low_pass_filter(
    forces_n: NDArray[np.float64], before_n: NDArray[np.float64] = AT_REST_N
) -> NDArray[np.float64]:
    """Low-pass filtered forces (steps, 2, 3), given the filtered forces (2, 3) of the step before."""
    share = 1 - math.exp(-2 * np.pi * FORCE_FILTER_HZ * PHYSICS_STEP_S)
    filtered_forces_n, now_n = np.empty_like(forces_n), before_n
    for step, force_n in enumerate(forces_n):
        now_n = now_n + share * (force_n - now_n)
        filtered_forces_n[step] = now_n
    return filtered_forces_n
