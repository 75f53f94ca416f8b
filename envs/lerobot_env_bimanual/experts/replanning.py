"""The replanning expert, which starts its script again after something other than its hands has moved a thing.

Scripts read where things are, and use it for several stages. That is right as long as only the hands move them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.results.expert_report import PlayerName
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Move, Player, expert
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.world.scene_view import SceneView

JUMP_M = 0.005
"""In one control tick, from rest to rest. No hand that starts to push gets a thing that far, and leaves it at rest."""
REST_M_S = 0.01


@dataclass(frozen=True, eq=False)
class _FreeThings:
    """Where all bodies with a free joint are, (n, 3) m, and how fast (n,) m/s."""

    positions_m: NDArray[np.float64]
    speeds_m_s: NDArray[np.float64]

    @classmethod
    def of(cls, scene: SceneView) -> _FreeThings:
        model, data = scene.model, scene.data
        is_free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
        xyz = np.arange(3)
        velocities = data.qvel[model.jnt_dofadr[is_free, None] + xyz]
        return cls(data.qpos[model.jnt_qposadr[is_free, None] + xyz], np.linalg.norm(velocities, axis=1))

    def have_jumped_since(self, before: _FreeThings) -> bool:
        """Whether something lay still a tick ago, and lies still elsewhere."""
        moved_m = np.linalg.norm(self.positions_m - before.positions_m, axis=1)
        is_still = np.maximum(self.speeds_m_s, before.speeds_m_s) < REST_M_S
        return bool(np.any(is_still & (moved_m > JUMP_M)))


def expert_under(axes: Iterable[str]) -> PlayerName:
    """Name of the expert under axes of perturbation: the replanning one if an axis moves things during the episode.

    Args:
        axes: their names; none in the nominal world.
    """
    return "replanning" if any(AXES.get(axis).disturb for axis in axes) else "expert"


def expert_of(env: BimanualEnv, codec: KeyposeCodec | None = None) -> Player:
    """The expert of an environment, the same in demonstrations, sweeps and reports.

    Args:
        env: its perturbations say whether things move later.
        codec: round every keypose to its voxels and bins.
    """
    players = {"expert": expert, "replanning": replanning}
    return players[expert_under(env.perturbations.magnitudes)](codec)


def replanning(codec: KeyposeCodec | None = None) -> Player:
    """The task's script, started again from the present scene each time that something other than a hand has moved a thing.

    Args:
        codec: round every keypose to its voxels and bins.
    """
    script = expert(codec)

    def play(env: BimanualEnv) -> Iterator[Move]:
        seen, has_jumped = _FreeThings.of(env.scene), False

        def watch(env: BimanualEnv, _: NDArray[np.float32] | None = None) -> None:
            nonlocal seen, has_jumped
            before, seen = seen, _FreeThings.of(env.scene)
            has_jumped |= seen.have_jumped_since(before)

        with env.observed_by(watch):
            is_at_end = False
            while not is_at_end:
                has_jumped, is_at_end = False, True
                for move in script(env):
                    yield move
                    watch(env)
                    if has_jumped:
                        is_at_end = False
                        break

    return play
