"""Records episodes as states and films them: players side by side, the camera turned and zoomed to hands and moved objects."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import ROOM_CAMERA_NAMES
from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.props.prop import camera_axes
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene, SceneState
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter, captioned

SIZE = (480, 640)
FRAMED_TICKS = 10
"""One in this many states is used to turn and zoom a camera."""
MOVED_M = 0.002
"""Travel along an axis from which on an object counts as moved: less than that of a button."""
ROOM_M = 0.16
"""Margin around hands and moved objects in the image."""


@dataclass(frozen=True)
class Rollout:
    """A played episode: its outcome, its states before every tick and at the end, and the number of keyposes until each."""

    outcome: EpisodeOutcome
    states: Sequence[SceneState]
    keyposes: Sequence[int]


def rollout(env: BimanualEnv, seed: int, player: Player) -> Rollout:
    """Play an episode as `run_episode` does, and keep every state of it."""
    states, keyposes = list[SceneState](), list[int]()

    def note(env: BimanualEnv, _: object = None) -> None:
        states.append(env.scene.save_state())
        keyposes.append(env.progress.keyposes)

    with env.observed_by(note):
        outcome = run_episode(env, seed, player)
    note(env)
    return Rollout(outcome, states, keyposes)


def write_film(env: BimanualEnv, rollouts: Mapping[str, Rollout], stem: Path, camera: str = "front") -> Path:
    """Write a video, in which players that ended earlier keep their last picture.

    Args:
        env: environment of all the rollouts; it is left in the last state that was rendered.
        rollouts: the same episode by name of the player, from left to right.
        stem: path of the file without its suffix; the folder is made.
        camera: name of the camera; a fixed one that is not perturbed turns and zooms to the hands and to what moves.

    Returns:
        The file.

    Raises:
        BimanualError: it cannot be written, or not be rendered.
    """
    view, outcome = {}, next(iter(rollouts.values())).outcome
    name = f"{env.task} v{outcome.variation} {env.options.split} seed{outcome.seed}"
    played = [episode.states for episode in rollouts.values()]
    # A perturbed camera shows what it sees.
    if camera in ROOM_CAMERA_NAMES and "cam_quat" not in played[0][0].appearance.fields:
        seen = [state for states in played for state in (*states[::FRAMED_TICKS], states[-1])]
        view = zoomed_camera_fields(env.scene, camera, seen, SIZE)
    with Renderer(env.scene, (camera,), *SIZE, env.options.render_quality) as renderer:

        @lru_cache(2 * len(rollouts))
        def picture(player: str, tick: int) -> NDArray[np.uint8]:
            """The scene at a tick; at the last one with the verdict."""
            episode = rollouts[player]
            env.scene.restore_state(episode.states[tick])
            env.scene.appearance = env.scene.appearance.with_fields(**view)
            rgb, _ = renderer.render()[camera]
            caption = f"{name} {player}, {tick * TICK_S:.1f} s, keypose {episode.keyposes[tick]}"
            verdict = "success" if episode.outcome.success else "failure"
            is_last = tick == len(episode.states) - 1
            return captioned(rgb, caption, verdict if is_last else "")

        writer = VideoWriter(stem.parent, stem.name)
        for tick in range(max(map(len, played))):
            ticks = [min(tick, len(states) - 1) for states in played]
            writer.add(np.hstack([*map(picture, rollouts, ticks)]))
        film = writer.close("", name=f"{stem.name}.mp4")
    assert film is not None  # an episode has at least one state
    return film


def zoomed_camera_fields(
    scene: Scene, camera: str, states: Sequence[SceneState], size: tuple[int, int]
) -> dict[str, NDArray[np.float64]]:
    """Model fields for an `Appearance` that make a fixed camera show hands and moved objects as large as possible.

    The image is `size` (height, width) pixels large, the states are moments from the start on; the scene is left in the last one.
    """
    model, index = scene.model, scene.model.camera(camera).id
    places_m = np.empty((len(states), model.nbody, 3))
    for state, places in zip(states, places_m, strict=True):
        scene.restore_state(state)
        places[:] = scene.data.xipos
    is_hand = np.any([scene.bodies(scene.arm_pair.hand_body(arm)) for arm in ARMS], axis=0)
    # The hands come from far above.
    is_thing = (np.ptp(places_m, axis=0).max(axis=1) > MOVED_M) & (scene.arm_of_body < 0)
    things_m, hands_m = places_m[:, is_thing], places_m[1:, is_hand]
    points_m = np.concatenate([things_m.reshape(-1, 3), hands_m.reshape(-1, 3)])
    eye, half = scene.data.cam_xpos[index], math.tan(math.radians(model.cam_fovy[index]) / 2)
    axes, sides = scene.data.cam_xmat[index].reshape(3, 3), []
    for _ in range(3):  # where the middle of what is seen moves to the middle of the image
        right, up, back = ((points_m - eye) @ axes).T
        room = ROOM_M / -back
        sides = [(np.min(way / -back - room), np.max(way / -back + room)) for way in (right, up)]
        axes = camera_axes(-(axes @ np.array([*np.mean(sides, axis=1), -1.0])), up=(0, 0, 1))
    wide, high = np.ptp(sides, axis=1) / 2
    fovy, quat_wxyz = model.cam_fovy.copy(), model.cam_quat.copy()
    fovy[index] = 2 * math.degrees(math.atan(min(half, max(high, wide * size[0] / size[1]))))
    quat_wxyz[index] = matrix_to_quat_wxyz(axes)
    return {"cam_fovy": fovy, "cam_quat": quat_wxyz}
