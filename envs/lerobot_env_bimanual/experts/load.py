"""Measurements of an expert's episode: the arms' loads against the limits of real arms, keyframes, and a replay.

Measured at every step of physics (2 ms), of both arms:

* the torque of each motor, gravity compensation included, over its limit, and how often one is at its limit;
* the net force between an arm and everything else that it touches, as an arm that senses external forces through its
  joints would measure it: after a first-order low-pass filter of 10 Hz, the bandwidth that Franka states for its force
  control. The squeezing forces of a hand's two fingers cancel out;
* the speed of the fingers, averaged over 10 ms, so that single impacts do not count;
* the depth to which two bodies penetrate each other.

Measured of the commands that the arms got, after perturbations, one per tick of 50 ms: velocity, acceleration and jerk of each joint over its limit, by
differences. These are the values that the quadratic spline of the scene's commands reaches: its accelerations are
constant within a tick and step between two ticks within one step of physics.
"""

from collections.abc import Iterable, Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.dataset.schema import state_hash_column
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import ARM_ACTION_DIM, discover_keyframes
from lerobot_bimanual.results.episode import LoadMetrics
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contact_forces import ContactForces, low_pass_filter
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.worlds import MAX_FORCE_N

type ReplayMode = Literal["none", "joint", "keypose"]
"""By joint actions, one per tick, or by keyposes, a whole motion each."""

SATURATED = 0.999
"""Share of its torque limit from which on a motor counts as saturated."""
FINGER_STEPS = 5
"""Over which the speed of a finger is averaged."""
KEYFRAME_TOLERANCE_FRAMES = 2

BOUNDS = {
    "torque": 1.0,
    "saturated": 0.01,
    "velocity": 1.0,
    "acceleration": 1.0,
    "jerk": 1.0,
    "contact_force_n": MAX_FORCE_N,
    "finger_speed_m_s": 0.2,
    "penetration_mm": 2.0,
}
"""Upper bounds of an expert's loads in an episode.

A saturated motor makes the arm late. Franka recommends avoiding this but does not require it, so it is allowed for moments.
`worlds.ProtectiveStop` says where the bound of force comes from. The bound of finger speed is franka_description's for the
hand.
"""


def bounds_of(task: str) -> dict[str, float]:
    """`BOUNDS`, overridden by those of a task."""
    own = dict(get_task(task).spec.load_bounds)
    for name in own.keys() - BOUNDS.keys():
        raise InvalidChoice(f"a name in load_bounds of {task}", name, BOUNDS)
    return BOUNDS | own


def excesses(task: str, load: LoadMetrics) -> Iterator[tuple[str, str]]:
    """Yield the name of each load above its bound in a task, and a message with both numbers."""
    for name, most in bounds_of(task).items():
        if (number := getattr(load, name)) > most:
            where = f" ({load.penetrating})" if name == "penetration_mm" else ""
            yield name, f"{name} is {number:.3g}{where}, but must be at most {most:g}"


def is_within_reflex_limits(task: str, load: LoadMetrics) -> bool:
    """Whether real arms would have gone through an episode without stopping themselves."""
    reflexes = ("velocity", "acceleration", "contact_force_n")
    return not any(name in reflexes for name, _ in excesses(task, load))


class LoadMeter:
    """Measures one episode of a scene; it only reads, so the episode goes on bit for bit as without it.

    Args:
        scene: the scene, at any time between its compilation and the first tick of the episode.
    """

    def __init__(self, scene: Scene):
        model, pair = scene.model, scene.arm_pair
        self._scene, self._forces = scene, ContactForces(scene)
        self._joint_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.joint_names(arm)]
        self._finger_dofs = [model.joint(name).dofadr[0] for arm in ARMS for name in pair.finger_names(arm)]
        self._torques, self._speeds = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
        self._commands: list[NDArray[np.float32]] = []

    def observe_tick(self) -> None:
        """Note what the arms were given last, before the next tick."""
        self._commands += (1 if self._commands else 3) * [self._scene.commanded]  # they stood there at first

    def observe_step(self) -> None:
        """Take a step of physics into account, right after it, while its forces are known."""
        self._forces.note()
        self._torques.append(self._scene.data.qfrc_actuator[self._joint_dofs])
        self._speeds.append(self._scene.data.qvel[self._finger_dofs])

    def result(self) -> LoadMetrics:
        """The peaks, at the end of the episode."""
        pair, (forces_n, depth_m, bodies) = self._scene.arm_pair, self._forces.take()
        torques = np.reshape(self._torques, (-1, len(ARMS), JOINTS_PER_ARM)) / pair.torque_limit_nm
        sums = np.cumsum(np.reshape(self._speeds, (-1, len(self._finger_dofs))), axis=0)
        commands = np.array([*self._commands, self._scene.commanded], dtype=np.float64)
        joints_rad = commands.reshape(-1, len(ARMS), ARM_ACTION_DIM)[..., :-1]
        velocity = np.diff(joints_rad, axis=0) / TICK_S
        acceleration = np.diff(velocity, axis=0) / TICK_S
        jerk = np.diff(acceleration, axis=0) / PHYSICS_STEP_S
        found = {
            "torque": _peak(torques),
            "saturated": float((np.abs(torques) > SATURATED).any(axis=(1, 2)).sum() / max(len(torques), 1)),
            "velocity": _peak(velocity / pair.velocity_limit_rad_s),
            "acceleration": _peak(acceleration / pair.acceleration_limit_rad_s2),
            "jerk": _peak(jerk / pair.jerk_limit_rad_s3),
            "contact_force_n": _peak(np.linalg.norm(low_pass_filter(forces_n), axis=-1)),
            "finger_speed_m_s": _peak((sums[FINGER_STEPS:] - sums[:-FINGER_STEPS]) / FINGER_STEPS),
            "penetration_mm": 1000 * depth_m,
        }
        # Records hold as many digits as mean something.
        rounded = {name: float(f"{peak:.6g}") for name, peak in found.items()}
        return LoadMetrics(**rounded, penetrating=bodies)


def _peak(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max(initial=0.0))


def run_measured(
    env: BimanualEnv, seed: int, player: Player, replay_mode: ReplayMode = "none"
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
        meters[0].observe_tick()
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
        hashes.append(state_hash_column(env.state_hash()))
        again = actions if replay_mode == "joint" else keyposes
        found["replayed"] = replays(env, seed, again, hashes)
    return outcome.model_copy(update=found)


def replays(env: BimanualEnv, seed: int, actions: Iterable[ArrayLike], hashes: list[int]) -> bool:
    """Whether actions from a seed solve the episode through the recorded states, bit for bit, and no others.

    Args:
        env: environment of the episode's task and variation, whose control mode takes the actions.
        seed: seed of the episode.
        actions: recorded joint actions (16,) or keyposes (18,), all of them.
        hashes: of the state before every tick and at the end, as datasets store them.
    """
    again = list[int]()

    def note(env: BimanualEnv, _: NDArray | None = None) -> None:
        again.append(state_hash_column(env.state_hash()))

    env.reset(seed=seed, options={"variation": env.variation})
    with env.observed_by(note):
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated or again != hashes[: len(again)]:
                break
    note(env)
    return env.progress.succeeded and again == hashes


def keyframes_found(joint_actions: NDArray[np.float32], ticks: list[int]) -> bool:
    """Whether keyframe discovery on joint actions (n, 16) finds the ends of keyposes of these ticks, and nothing else.

    An end counts as found within `KEYFRAME_TOLERANCE_FRAMES`.
    """
    found, expected = np.array(discover_keyframes(joint_actions)), np.cumsum(ticks)
    return len(found) == len(expected) and np.allclose(found, expected, 0, KEYFRAME_TOLERANCE_FRAMES)
