"""What an episode asks of the arms, held against what the real ones allow.

Measured at every step of physics (2 ms), of both arms:

* the torque of each motor, gravity compensation included, over its limit, and how often one is at its limit;
* the net force between an arm and all else that it touches, filtered as an arm that feels outside forces through its
  joints would: by a first-order low pass of 10 Hz, the bandwidth that Franka states for its force control. What the
  two fingers of a hand squeeze cancels out;
* the speed of the fingers;
* how deep two bodies lie in each other.

Measured of the joint actions, one per tick of 50 ms: velocity, acceleration and jerk of each joint over its limit, by
differences. They are those of the smoothest motion through the commands.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contacts import ContactQueries
from lerobot_env_bimanual.world.scene import TICK_S, Scene

FORCE_FILTER_HZ = 10.0
"""Bandwidth of the low pass through which an arm feels forces: 16 ms to 63 % of a step."""
SATURATED = 0.999
"""Share of its limit from which on a motor gives all it has."""
NONE = -1
"""No arm."""
NO_FORCE = np.zeros((len(ARMS), 3))


@dataclass(frozen=True)
class Strain:
    """The peaks of an episode, or of several.

    Attributes:
        torque: largest motor torque, gravity included, over its limit.
        saturated: share of the time in which any motor was at its limit.
        velocity: largest commanded joint velocity over its limit.
        acceleration: the same of accelerations.
        jerk: the same of jerks.
        contact_force_n: largest force between an arm and all else, filtered.
        finger_speed_m_s: of the fastest finger.
        penetration_mm: deepest that two bodies lay in each other.
        penetrating: those two bodies, empty if none touched.
    """

    torque: float
    saturated: float
    velocity: float
    acceleration: float
    jerk: float
    contact_force_n: float
    finger_speed_m_s: float
    penetration_mm: float
    penetrating: str


BOUNDS = {
    "torque": 1.0,
    "saturated": 0.01,
    "velocity": 1.0,
    "acceleration": 1.0,
    "jerk": 1.0,
    "contact_force_n": 100.0,
    "finger_speed_m_s": 0.2,
    "penetration_mm": 2.0,
}
"""Of an expert's episode.

A motor that gives all it has makes the arm late, and does not stop it: it may for moments. How hard an arm may push
before it stops is for its user to choose: libfranka's examples set 20 N for free motion (`setDefaultBehavior`) and 100 N
along an axis for impedance and force control, where contact is meant, as it is in tasks that squeeze and push; here
100 N bound the whole force. Fingers may move as fast as franka_description says of the hand.
"""


def excesses(strain: Strain) -> Iterator[tuple[str, str]]:
    """Name of each number that is beyond its bound, and how far."""
    for name, most in BOUNDS.items():
        number = getattr(strain, name)
        if number > most:
            where = f" ({strain.penetrating})" if name == "penetration_mm" else ""
            yield name, f"{name} is {number:.3g}{where}, but must be at most {most:g}"


def peak_strain(strains: Sequence[Strain]) -> Strain:
    """The peaks of several episodes, field by field."""
    deepest = max(strains, key=lambda strain: strain.penetration_mm)
    peaks = {name: max(getattr(strain, name) for strain in strains) for name in BOUNDS}
    return Strain(**peaks, penetrating=deepest.penetrating)


class StrainMeter:
    """Measures one episode of a scene; it only reads, so the episode goes on bit for bit as without it.

    Args:
        scene: the scene, at any time between its compilation and the first tick of the episode.
    """

    def __init__(self, scene: Scene):
        model, pair = scene.model, scene.arm_pair
        contacts = ContactQueries(model, scene.data)
        arm_of_geom = np.full(model.ngeom, NONE)
        for arm in ARMS:
            arm_of_geom[contacts.geoms(pair.base_body(arm))] = arm.ordinal
        self._scene = scene
        self._arm_of_geom: list[int] = arm_of_geom.tolist()
        self._joint_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.joint_names(arm)]
        self._finger_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.finger_names(arm)]
        self._torques_nm: list[NDArray[np.float64]] = []
        self._finger_speeds_m_s: list[NDArray[np.float64]] = []
        self._forces_n: list[NDArray[np.float64]] = []
        self._actions: list[NDArray[np.float32]] = []
        self._deepest_m = 0.0
        self._deepest_geoms: tuple[int, int] | None = None

    def observe_tick(self, joint_action: NDArray[np.float32]) -> None:
        """Take the joint action (16,) of a tick into account, before it is executed."""
        if not self._actions:
            self._actions += 3 * [self._scene.commanded]  # it stood there
        self._actions.append(joint_action.copy())

    def observe_step(self) -> None:
        """Take a step of physics into account, right after it, while its forces are known."""
        data = self._scene.data
        self._torques_nm.append(data.qfrc_actuator[self._joint_dofs])
        self._finger_speeds_m_s.append(data.qvel[self._finger_dofs])
        self._forces_n.append(self._look_at_contacts() if data.ncon else NO_FORCE)

    def result(self) -> Strain:
        """The peaks so far."""
        limits = self._scene.arm_pair.joint_limits
        torques = np.abs(np.array(self._torques_nm)) / np.tile(limits.torque_nm, len(ARMS))
        joints = np.array([by_arm(action)[:, :-1] for action in self._actions], dtype=np.float64)
        velocity, acceleration, jerk = (np.diff(joints, order, axis=0) / TICK_S**order for order in (1, 2, 3))
        return Strain(
            torque=_peak(torques),
            saturated=float((torques > SATURATED).any(axis=1).mean()),
            velocity=_peak(velocity / limits.velocity_rad_s),
            acceleration=_peak(acceleration / limits.acceleration_rad_s2),
            jerk=_peak(jerk / limits.jerk_rad_s3),
            contact_force_n=_peak(np.linalg.norm(felt(np.array(self._forces_n)), axis=-1)),
            finger_speed_m_s=_peak(np.array(self._finger_speeds_m_s)),
            penetration_mm=1000 * self._deepest_m,
            penetrating=self._penetrating(),
        )

    def _look_at_contacts(self) -> NDArray[np.float64]:
        """Net force (2, 3) in N, world frame, on each arm; the deepest contact is noted."""
        model, data, arm_of = self._scene.model, self._scene.data, self._arm_of_geom
        contact = data.contact
        distances, pairs = contact.dist, contact.geom.reshape(-1, 2).tolist()
        deepest = distances.argmin()
        if distances[deepest] < -self._deepest_m:
            self._deepest_m, self._deepest_geoms = -float(distances[deepest]), pairs[deepest]
        forces_n, wrench = np.zeros((len(ARMS), 3)), np.empty(6)
        for index, (first, second) in enumerate(pairs):
            if arm_of[first] == arm_of[second]:  # of no arm, or of one with itself
                continue
            mujoco.mj_contactForce(model, data, index, wrench)
            force_n = wrench[:3] @ contact.frame.reshape(-1, 3, 3)[index]  # on the second, world axes in rows
            for geom, sign in ((first, -1), (second, 1)):
                if arm_of[geom] != NONE:
                    forces_n[arm_of[geom]] += sign * force_n
        return forces_n

    def _penetrating(self) -> str:
        if self._deepest_geoms is None:
            return ""
        model = self._scene.model
        return ", ".join(model.body(model.geom_bodyid[geom]).name for geom in self._deepest_geoms)


def felt(forces_n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Forces (steps, 2, 3) through the low pass."""
    share = 1 - np.exp(-2 * np.pi * FORCE_FILTER_HZ * PHYSICS_STEP_S)
    felt_n, now_n = np.empty_like(forces_n), np.zeros(forces_n.shape[1:])
    for step, force_n in enumerate(forces_n):
        now_n = now_n + share * (force_n - now_n)
        felt_n[step] = now_n
    return felt_n


def _peak(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max(initial=0.0))
