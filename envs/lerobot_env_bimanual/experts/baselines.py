"""Baselines: players that hold still, move at random, repeat mean keyposes or the nearest ones, or ignore the words.

Each is played through the same environment as the experts and the policies, and leniently: an arm whose keypose cannot
be reached stays where it is, and the rest goes on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM, QUATERNION
from lerobot_bimanual.results.expert_report import PlayerName
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.runner import Move, Player, expert, replanning
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.planner import KeyposeFailure, KeyposePlanner
from lerobot_env_bimanual.stage import Stage, home_keypose, stages_and_targets
from lerobot_env_bimanual.task import Script
from lerobot_env_bimanual.world.scene_view import SceneView

RANDOM_KEYPOSES = 25
DEMONSTRATIONS = 100
"""Training demonstrations of each variation that `nearest` remembers."""
METRES_PER_RAD = 0.1
"""In the distance of two layouts, a rotation by one rad counts as much as a shift by this."""


def make_player(
    name: PlayerName,
    seed: int,
    codec: KeyposeCodec | None = None,
    mean_keyposes: Sequence[ArrayLike] = (),
    plan: int = 0,
) -> Player:
    """Make the player called `name`.

    Args:
        name: name of the player.
        seed: seeds the generators of `random`, `mixed` and `language_ablated`; the episode's own stays untouched.
        codec: rounds the keyposes of the experts.
        mean_keyposes: (18,) each, the keyposes of `open_loop` in every scene; see `mean_of_episodes`.
        plan: number of the plan of `expert`.
    """
    rng = np.random.default_rng(seed)
    players: dict[PlayerName, Player] = {
        "expert": expert(codec, plan),
        "replanning": replanning(codec),
        "noop": noop,
        "random": partial(random, rng=rng),
        "open_loop": partial(open_loop, keyposes=mean_keyposes),
        "nearest": nearest,
        "mixed": partial(mixed, rng=rng),
        "language_ablated": partial(language_ablated, rng=rng),
    }
    return players[name]


def noop(env: BimanualEnv) -> Iterator[Move]:
    """Hold still until time is up."""
    hold = env.scene.commanded
    while True:
        yield Move("hold", hold)


def random(env: BimanualEnv, rng: np.random.Generator) -> Iterator[Move]:
    """Keyposes drawn from the whole workspace, with random rotations and grippers."""

    def keypose() -> Keypose:
        pose = Pose(VOXEL_WORKSPACE.sample(rng), quat_wxyz_canonical(rng.normal(size=4)))
        return Keypose(pose, gripper_open=bool(rng.integers(2)), ignore_collisions=bool(rng.integers(2)))

    targets = (BimanualKeypose(keypose(), keypose()) for _ in range(RANDOM_KEYPOSES))
    return _reachable_moves(env, _numbered(targets), rng)


def open_loop(env: BimanualEnv, keyposes: Sequence[ArrayLike]) -> Iterator[Move]:
    """The same keyposes (18,) in every episode, whatever the scene."""
    targets = [BimanualKeypose.from_vector(keypose) for keypose in keyposes]
    return _reachable_moves(env, _numbered(targets), np.random.default_rng(0))


def nearest(env: BimanualEnv) -> Iterator[Move]:
    """The keyposes of the training demonstration whose scene is most like this one, unchanged.

    It knows the poses and sizes of all props and only looks up demonstrations. What it solves can be solved by memory alone.
    """
    here, bank = Layout.of(env), demonstrations(env.task, env.variation, env.options.setting)
    _, keyposes = min(bank, key=lambda known: here.distance_m(known[0]))
    return open_loop(env, [*keyposes])


def mixed(env: BimanualEnv, rng: np.random.Generator) -> Iterator[Move]:
    """The left arm by one of the task's plans and the right arm by another, drawn at random, leniently."""
    left_plan, right_plan = rng.permutation(len(env.task_definition.spec.plans))[:2]

    def targets() -> Iterator[tuple[str, BimanualKeypose]]:
        left_target = right_target = home_keypose(env.scene)
        left_script, right_script = (
            env.task_definition.script_for_plan(env.progress.variation, int(plan))(env.scene)
            for plan in (left_plan, right_plan)
        )
        for left_stage, right_stage in zip_longest(left_script, right_script, fillvalue=Stage("stay")):
            left_target, right_target = left_stage.keypose(left_target), right_stage.keypose(right_target)
            yield left_stage.name, BimanualKeypose(left_target.left, right_target.right)

    return _reachable_moves(env, targets(), np.random.default_rng(0))


def language_ablated(env: BimanualEnv, rng: np.random.Generator) -> Iterator[Move]:
    """The expert's keyposes for an instruction drawn at random among those that the scene allows."""
    scripts = env.task_definition.scripts_for_all_instructions(env.scene)
    return play_script(env, scripts[rng.integers(len(scripts))])


def play_script(env: BimanualEnv, script: Script) -> Iterator[Move]:
    """The stages of a script, leniently."""
    targets = ((stage.name, target) for stage, target in stages_and_targets(script, env.scene))
    return _reachable_moves(env, targets, np.random.default_rng(0))


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


def _reachable_moves(
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


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the bodies of all props are, and how large.

    Attributes:
        positions_m: (n, 3) world frame.
        quats_wxyz: (n, 4) world frame.
        sizes_m: (n, 3) extents in the body's own frame.
    """

    positions_m: NDArray[np.float64]
    quats_wxyz: NDArray[np.float64]
    sizes_m: NDArray[np.float64]

    @classmethod
    def of(cls, env: BimanualEnv) -> Layout:
        """That of the present scene."""
        model, data = env.scene.model, env.scene.data
        roots = [model.body(prop.name).id for prop in env.scene.props]
        bodies = np.flatnonzero(np.isin(model.body_rootid, roots))
        sizes_m = np.array([_size_m(env.scene, body) for body in bodies])
        return cls(data.xpos[bodies], data.xquat[bodies], sizes_m)

    def distance_m(self, other: Layout) -> float:
        """Distance of two layouts: the root of the summed squares of all differences in position, rotation and size."""
        if len(self.positions_m) != len(other.positions_m):
            return np.inf
        cosines = np.abs((self.quats_wxyz * other.quats_wxyz).sum(axis=1)).clip(max=1.0)
        parts = (
            self.positions_m - other.positions_m,
            self.sizes_m - other.sizes_m,
            2 * METRES_PER_RAD * np.arccos(cosines),  # noqa: TID251 (it is only compared)
        )
        return float(np.sqrt(sum(np.square(part).sum() for part in parts)))


@lru_cache(maxsize=8)
def demonstrations(task: str, variation: int, setting: str) -> list[tuple[Layout, NDArray[np.float32]]]:
    """Layout and keyposes (n, 18) of each training demonstration of a variation, rehearsed without physics."""
    env, bank = BimanualEnv(task, variation=variation, split="train", obs="state", setting=setting), []
    for seed in range(DEMONSTRATIONS):
        try:
            env.reset(seed=seed)
        except PlacementFailure:
            continue
        bank.append((Layout.of(env), rehearsed_keyposes(env)))
    env.close()
    return bank


def rehearsed_keyposes(env: BimanualEnv) -> NDArray[np.float32]:
    """The expert's keyposes (n, 18) in the present scene, as a rehearsal without physics goes through them."""
    stages: list[Stage] = []

    def noted(view: SceneView) -> Iterator[Stage]:
        for stage in env.task_definition.script(view, env.progress.variation):
            stages.append(stage)
            yield stage

    Rehearsal(env.scene).infeasibility(noted)
    return np.array([target.to_vector() for _, target in stages_and_targets(lambda _: stages, env.scene)])


def _size_m(view: SceneView, body: int) -> NDArray[np.float64]:
    """Extents (3,) of a body's geoms along its own axes."""
    model = view.model
    geoms = np.flatnonzero(model.geom_bodyid == body)
    if not len(geoms):
        return np.zeros(3)
    rotations = np.zeros((len(geoms), 9))
    for rotation, geom in zip(rotations, geoms, strict=True):
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    frames = rotations.reshape(-1, 3, 3)
    middles = model.geom_pos[geoms] + (frames @ model.geom_aabb[geoms, :3, None])[..., 0]
    half_m = (np.abs(frames) @ model.geom_aabb[geoms, 3:, None])[..., 0]
    return (middles + half_m).max(axis=0) - (middles - half_m).min(axis=0)
