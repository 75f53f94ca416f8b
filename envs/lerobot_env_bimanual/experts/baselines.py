"""Baselines: players that hold still, move at random, repeat mean keyposes or the nearest ones, or ignore the words.

Each is played through the same environment as the experts and the policies, and leniently: an arm whose keypose cannot
be reached stays where it is, and the rest goes on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM, QUATERNION
from lerobot_bimanual.results.expert_report import PlayerName
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.nearest import nearest_keyposes
from lerobot_env_bimanual.experts.runner import Move, Player, expert, home_keypose, replanning
from lerobot_env_bimanual.motion.planner import KeyposeFailure, KeyposePlanner
from lerobot_env_bimanual.task import Script

RANDOM_KEYPOSES = 25


def make_player(
    name: PlayerName, seed: int, codec: KeyposeCodec | None = None, mean_keyposes: Sequence[ArrayLike] = ()
) -> Player:
    """The player of a name.

    Args:
        name: name of the player.
        seed: seeds the generators of `random` and `language_ablated`; the episode's own stays untouched.
        codec: rounds the keyposes of the experts.
        mean_keyposes: (18,) each, the keyposes of `open_loop` in every scene; see `mean_of_episodes`.
    """
    players: dict[PlayerName, Player] = {
        "expert": expert(codec),
        "replanning": replanning(codec),
        "noop": noop,
        "random": random(np.random.default_rng(seed)),
        "open_loop": open_loop(mean_keyposes),
        "nearest": nearest,
        "language_ablated": language_ablated(np.random.default_rng(seed)),
    }
    return players[name]


def noop(env: BimanualEnv) -> Iterator[Move]:
    """Hold still until time is up."""
    hold = env.scene.commanded
    while True:
        yield Move("hold", hold)


def random(rng: np.random.Generator) -> Player:
    """Keyposes drawn from the whole workspace, with random rotations and grippers."""

    def keypose() -> Keypose:
        pose = Pose(VOXEL_WORKSPACE.sample(rng), quat_wxyz_canonical(rng.normal(size=4)))
        return Keypose(pose, gripper_open=bool(rng.integers(2)), ignore_collisions=bool(rng.integers(2)))

    def play(env: BimanualEnv) -> Iterator[Move]:
        targets = (BimanualKeypose(keypose(), keypose()) for _ in range(RANDOM_KEYPOSES))
        return _leniently(env, _numbered(targets), rng)

    return play


def open_loop(keyposes: Sequence[ArrayLike]) -> Player:
    """The same keyposes (18,) in every episode, whatever the scene."""
    targets = [BimanualKeypose.from_vector(keypose) for keypose in keyposes]
    return lambda env: _leniently(env, _numbered(targets), np.random.default_rng(0))


def nearest(env: BimanualEnv) -> Iterator[Move]:
    """The keyposes of the training demonstration whose scene is most like this one, unchanged."""
    return open_loop([*nearest_keyposes(env)])(env)


def language_ablated(rng: np.random.Generator) -> Player:
    """The expert's keyposes for an instruction drawn at random among those that the scene allows."""

    def play(env: BimanualEnv) -> Iterator[Move]:
        scripts = env.task_definition.readings(env.scene)
        yield from play_script(env, scripts[rng.integers(len(scripts))])

    return play


def play_script(env: BimanualEnv, script: Script) -> Iterator[Move]:
    """The stages of a script, leniently."""

    def targets() -> Iterator[tuple[str, BimanualKeypose]]:
        target = home_keypose(env.scene)
        for stage in script(env.scene):
            target = stage.keypose(target)
            yield stage.name, target

    return _leniently(env, targets(), np.random.default_rng(0))


def mean_of_episodes(episodes: Sequence[ArrayLike]) -> NDArray[np.float64]:
    """The average episode of an expert.

    Args:
        episodes: (n, 18) keyposes each, all of the same task and variation. Those with another number of
            keyposes than most are left out.

    Returns:
        (n, 18) mean positions, mean rotations and the flags of the majority.
    """
    arrays = [np.asarray(episode, dtype=np.float64) for episode in episodes]
    lengths = [len(array) for array in arrays]
    usual = max(sorted(set(lengths)), key=lengths.count)
    stacked = np.stack([array for array in arrays if len(array) == usual])
    arms = stacked.reshape(len(stacked), usual, len(ARMS), ARM_KEYPOSE_DIM)
    mean = arms.mean(axis=0)
    # The dominant eigenvector of the outer products of the quaternions (Markley 2007).
    outer = np.einsum("e...i,e...j->...ij", arms[..., QUATERNION], arms[..., QUATERNION])
    mean[..., QUATERNION] = quat_wxyz_canonical(np.linalg.eigh(outer).eigenvectors[..., -1])
    mean[..., QUATERNION.stop :] = mean[..., QUATERNION.stop :] > 0.5
    return mean.reshape(usual, KEYPOSE_DIM)


def _numbered(targets: Iterable[BimanualKeypose]) -> Iterator[tuple[str, BimanualKeypose]]:
    return ((f"keypose {number}", target) for number, target in enumerate(targets))


def _leniently(
    env: BimanualEnv, targets: Iterable[tuple[str, BimanualKeypose]], rng: np.random.Generator
) -> Iterator[Move]:
    planner = KeyposePlanner(env.scene)
    reached = home_keypose(env.scene)
    for name, target in targets:
        target = _reachable_part(planner, target, reached, rng)
        if target is not None:
            reached = target
            yield Move(name, target.to_vector())


def _reachable_part(
    planner: KeyposePlanner, target: BimanualKeypose, reached: BimanualKeypose, rng: np.random.Generator
) -> BimanualKeypose | None:
    """The target with every arm that cannot reach it left where it is; `None` if nothing can be planned."""
    for _ in range(len(ARMS) + 1):
        try:
            planner.plan(target, rng)
        except KeyposeFailure as failure:
            failed = [arm for arm in ARMS if failure.arm in (arm.value, "both")]
            stay = {arm.value: replace(target[arm], pose=reached[arm].pose) for arm in failed}
            target = replace(target, **stay)
        else:
            return target
    return None
