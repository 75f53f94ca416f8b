"""Net forces between each arm and all else that it touches, and how deep things lie in each other."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene_view import SceneView

FORCE_FILTER_HZ = 10.0
"""Bandwidth of the low pass through which an arm feels forces: 16 ms to 63 % of a step."""
NONE = -1
"""No arm."""
AT_REST_N = np.zeros((len(ARMS), 3))


class _Contacts(NamedTuple):
    """The contacts of one step, or of several.

    Attributes:
        geoms: (n, 2).
        depths_m: (n,), below zero where there is a gap.
        axes: (n, 9), of each contact's frame, in rows.
        dimensions: (n,), 1 without friction, else more.
        rows: (n,), where the forces of each begin; below zero if it has none.
        forces_n: (m,), of all contacts and other constraints. With elliptic cones those of a contact are its force along
            its axes, and torques.
    """

    geoms: NDArray[np.int32]
    depths_m: NDArray[np.float64]
    axes: NDArray[np.float64]
    dimensions: NDArray[np.int32]
    rows: NDArray[np.int32]
    forces_n: NDArray[np.float64]


class ContactForces:
    """The contacts of a scene, noted step by step and looked at now and then; it only reads."""

    def __init__(self, scene: SceneView):
        self._scene = scene
        self._arm_of_geom = scene.arm_of_body[scene.model.geom_bodyid]
        self._steps = 0
        self._noted: dict[int, _Contacts] = {}

    def note(self) -> None:
        """Note a step of physics, right after it, while its forces are known."""
        data = self._scene.data
        if data.ncon:
            each = data.contact
            noted = (each.geom, -each.dist, each.frame, each.dim, each.efc_address, data.efc_force)
            self._noted[self._steps] = _Contacts(*map(np.copy, noted))
        self._steps += 1

    def take(self) -> tuple[NDArray[np.float64], float, str]:
        """What was noted since the last time.

        Returns:
            (steps, 2, 3) net forces on each arm in N, world frame; the deepest penetration in m, and the two bodies, 0 and
            "" if there is none. What the two fingers of a hand squeeze cancels out.
        """
        forces_n, depth_m, bodies = np.zeros((self._steps, *AT_REST_N.shape)), 0.0, ""
        if self._noted:
            counts = [len(then.geoms) for then in self._noted.values()]
            contacts = _joined(list(self._noted.values()))
            self._add_forces(forces_n, np.repeat(list(self._noted), counts), contacts)
            deepest = contacts.depths_m.argmax()
            if contacts.depths_m[deepest] > 0:
                depth_m, model = float(contacts.depths_m[deepest]), self._scene.model
                touching = model.geom_bodyid[contacts.geoms[deepest]]
                bodies = ", ".join(model.body(body).name for body in touching)
        self._steps, self._noted = 0, {}
        return forces_n, depth_m, bodies

    def _add_forces(
        self, forces_n: NDArray[np.float64], steps: NDArray[np.int64], contacts: _Contacts
    ) -> None:
        """Add to the net forces (steps, 2, 3) on each arm, world frame, those of contacts at these steps (n,)."""
        arms = self._arm_of_geom[contacts.geoms]
        # Neither of no arm, nor of one with itself.
        outside = (arms[:, 0] != arms[:, 1]) & (contacts.rows >= 0)
        components = np.arange(3) * (contacts.dimensions[outside, None] > 1)
        local_n = contacts.forces_n[contacts.rows[outside, None] + components] * (components == np.arange(3))
        on_second_n = np.einsum("ni,nij->nj", local_n, contacts.axes[outside].reshape(-1, 3, 3))
        for side, sign in ((0, -1), (1, 1)):
            touched = arms[outside, side]
            on_arm = touched != NONE
            np.add.at(forces_n, (steps[outside][on_arm], touched[on_arm]), sign * on_second_n[on_arm])


def _joined(contacts: Sequence[_Contacts]) -> _Contacts:
    """Those of all steps; rows count on from step to step."""
    joined = _Contacts(*map(np.concatenate, zip(*contacts, strict=True)))
    begins = np.cumsum([0, *(len(then.forces_n) for then in contacts[:-1])])
    shift = np.repeat(begins, [len(then.rows) for then in contacts])
    return joined._replace(rows=np.where(joined.rows < 0, joined.rows, joined.rows + shift))


def felt(forces_n: NDArray[np.float64], before_n: NDArray[np.float64] = AT_REST_N) -> NDArray[np.float64]:
    """Forces (steps, 2, 3) through the low pass, given what was felt before, (2, 3)."""
    share = 1 - math.exp(-2 * np.pi * FORCE_FILTER_HZ * PHYSICS_STEP_S)
    felt_n, now_n = np.empty_like(forces_n), before_n
    for step, force_n in enumerate(forces_n):
        now_n = now_n + share * (force_n - now_n)
        felt_n[step] = now_n
    return felt_n
