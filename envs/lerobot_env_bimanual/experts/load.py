"""Measurements of an expert's episode: loads of the arms beside the limits of real ones, keyframes, and a replay.

Measured at every step of physics (2 ms), of both arms:

* the torque of each motor, gravity compensation included, over its limit, and how often one is at its limit;
* the net force between an arm and all else that it touches, filtered as an arm that feels outside forces through its
  joints would: by a first-order low pass of 10 Hz, the bandwidth that Franka states for its force control. What the
  two fingers of a hand squeeze cancels out;
* the speed of the fingers, on average over 10 ms, so that no single knock counts;
* how deep two bodies lie in each other.

Measured of the joint actions, one per tick of 50 ms: velocity, acceleration and jerk of each joint over its limit, by
differences. The scene's commands follow a quadratic spline, of which these are what it reaches: accelerations are
constant within a tick and step between two within one step of physics.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset.schema import state_hash_column
from lerobot_bimanual.joint_action import by_arm
from lerobot_bimanual.keyframes import discover_keyframes
from lerobot_bimanual.results.expert_report import EpisodeOutcome, LoadMetrics
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.replay import ReplayMode, replay
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S

FORCE_FILTER_HZ = 10.0
"""Bandwidth of the low pass through which an arm feels forces: 16 ms to 63 % of a step."""
SATURATED = 0.999
"""Share of its limit from which on a motor gives all it has."""
FINGER_STEPS = 5
"""Over which the speed of a finger is averaged."""
NONE = -1
"""No arm."""
KEYFRAME_TOLERANCE_FRAMES = 2


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

A motor that gives all it has makes the arm late; Franka recommends to stay below and does not require it, so it may for
moments. How hard an arm may push before it stops is for its user to choose: libfranka's examples set 20 N for free motion
(`setDefaultBehavior`) and 100 N along an axis for impedance and force control, where contact is meant, as it is in tasks
that squeeze and push; here 100 N bound the whole force. Fingers may move as fast as franka_description says of the hand.
"""


def bounds_of(task: str) -> dict[str, float]:
    """`BOUNDS`, with those of a task's own."""
    return BOUNDS | dict(get_task(task).spec.load_bounds)


def excesses(task: str, load: LoadMetrics) -> Iterator[tuple[str, str]]:
    """Name of each number that is beyond its bound in a task, and how far."""
    for name, most in bounds_of(task).items():
        if (number := getattr(load, name)) > most:
            where = f" ({load.penetrating})" if name == "penetration_mm" else ""
            yield name, f"{name} is {number:.3g}{where}, but must be at most {most:g}"


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


class LoadMeter:
    """Measures one episode of a scene; it only reads, so the episode goes on bit for bit as without it.

    Args:
        scene: the scene, at any time between its compilation and the first tick of the episode.
    """

    def __init__(self, scene: Scene):
        model, pair = scene.model, scene.arm_pair
        self._arm_of_geom = np.full(model.ngeom, NONE)
        for arm in ARMS:
            self._arm_of_geom[scene.geoms(pair.base_body(arm))] = arm.ordinal
        self._scene = scene
        self._joint_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.joint_names(arm)]
        self._finger_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.finger_names(arm)]
        # What is noted twenty-five times a tick is only copied, and looked at in the end.
        self._torques, self._speeds = scene.data.qfrc_actuator, scene.data.qvel
        self._torques_then: list[NDArray[np.float64]] = []
        self._speeds_then: list[NDArray[np.float64]] = []
        self._contacts_then: dict[int, _Contacts] = {}
        self._actions: list[NDArray[np.float32]] = []

    def observe_tick(self, joint_action: NDArray[np.float32]) -> None:
        """Take the joint action (16,) of a tick into account, before it is executed."""
        if not self._actions:
            self._actions += 3 * [self._scene.commanded]  # it stood there
        self._actions.append(joint_action.copy())

    def observe_step(self) -> None:
        """Take a step of physics into account, right after it, while its forces are known."""
        data = self._scene.data
        if data.ncon:
            each = data.contact
            noted = (each.geom, -each.dist, each.frame, each.dim, each.efc_address, data.efc_force)
            self._contacts_then[len(self._torques_then)] = _Contacts(*map(np.copy, noted))
        self._torques_then.append(self._torques.copy())
        self._speeds_then.append(self._speeds.copy())

    def result(self) -> LoadMetrics:
        """The peaks so far."""
        limits = self._scene.arm_pair.joint_limits
        torques = np.abs(self._torques_then)[:, self._joint_dofs] / np.tile(limits.torque_nm, len(ARMS))
        joints = np.array([by_arm(action)[:, :-1] for action in self._actions], dtype=np.float64)
        velocity = np.diff(joints, axis=0) / TICK_S
        acceleration = np.diff(velocity, axis=0) / TICK_S
        jerk = np.diff(acceleration, axis=0) / PHYSICS_STEP_S
        sums = np.cumsum(np.array(self._speeds_then)[:, self._finger_dofs], axis=0)
        finger_speeds = (sums[FINGER_STEPS:] - sums[:-FINGER_STEPS]) / FINGER_STEPS
        forces_n, depth_m, bodies = np.zeros((len(self._torques_then), len(ARMS), 3)), 0.0, ""
        if self._contacts_then:
            counts = [len(then.geoms) for then in self._contacts_then.values()]
            contacts = _joined(list(self._contacts_then.values()))
            self._add_forces(forces_n, np.repeat(list(self._contacts_then), counts), contacts)
            deepest = contacts.depths_m.argmax()
            if contacts.depths_m[deepest] > 0:
                depth_m, model = float(contacts.depths_m[deepest]), self._scene.model
                touching = model.geom_bodyid[contacts.geoms[deepest]]
                bodies = ", ".join(model.body(body).name for body in touching)
        return LoadMetrics(
            torque=_peak(torques),
            saturated=float((torques > SATURATED).any(axis=1).mean()),
            velocity=_peak(velocity / limits.velocity_rad_s),
            acceleration=_peak(acceleration / limits.acceleration_rad_s2),
            jerk=_peak(jerk / limits.jerk_rad_s3),
            contact_force_n=_peak(np.linalg.norm(felt(forces_n), axis=-1)),
            finger_speed_m_s=_peak(finger_speeds),
            penetration_mm=1000 * depth_m,
            penetrating=bodies,
        )

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


def run_measured(
    env: BimanualEnv, seed: int, player: Player, replay_mode: ReplayMode | Literal["none"] = "none"
) -> EpisodeOutcome:
    """Play one episode of an expert, and measure it if it is solved.

    Args:
        env: environment whose control mode takes keyposes.
        seed: seed of the reset.
        player: an expert.
        replay_mode: whether a solved episode is played again, by its joint actions or its keyposes; every state is
            compared. The replay starts another episode in the same environment.
    """
    meters, hashes = list[LoadMeter](), list[int]()
    actions, keyposes = list[NDArray[np.float32]](), list[NDArray[np.float32]]()

    def note(env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        if not meters:  # which scene it is shows at the reset
            meters.append(LoadMeter(env.scene))
        meters[0].observe_tick(joint_action)
        actions.append(joint_action.copy())
        hashes.append(state_hash_column(env.state_hash()))

    with env.observed_by(note, lambda: meters[0].observe_step()):
        outcome = run_episode(env, seed, player, lambda move: keyposes.append(move.action))
    if not outcome.success:
        return outcome
    found: dict[str, Any] = {
        "load": meters[0].result(),
        "keyframes_found": keyframes_found(np.array(actions), [move.ticks for move in outcome.moves]),
    }
    if replay_mode != "none":
        columns = dict(enumerate([*hashes, state_hash_column(env.state_hash())]))
        again = actions if replay_mode == "joint" else keyposes
        found["replayed"] = replay(env, seed, env.variation, again, columns).matches
    return outcome.model_copy(update=found)


def keyframes_found(joint_actions: NDArray[np.float32], ticks: list[int]) -> bool:
    """Whether keyframe discovery on joint actions (n, 16) finds the ends of keyposes of these ticks, and nothing else.

    An end counts as found within `KEYFRAME_TOLERANCE_FRAMES`.
    """
    found, expected = np.array(discover_keyframes(joint_actions)), np.cumsum(ticks)
    return len(found) == len(expected) and np.allclose(found, expected, 0, KEYFRAME_TOLERANCE_FRAMES)
