"""The command `task view`."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import check_range
from lerobot_bimanual.files import check_output_folder
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.options import STANDARD, EnvOptions


@dataclass
class TaskViewConfig:
    """Flags of `task view`."""

    task: str = "lift_ball"  # name of one task
    variation: str = "any"  # index, or `any` (drawn per episode)
    split: Literal["train", "val", "test"] = "test"  # the same seeds mean other episodes in each
    # in `varied` sizes, heights and places of things differ more
    setting: Literal["standard", "varied"] = "standard"
    first_seed: int = 0  # seed of the first episode
    episodes: int = 1  # number of episodes of which videos are written
    perturb: str = ""  # perturbations AXIS:LEVEL, separated by commas
    # Folder `pretrained_model` of a trained policy. The viewer shows the policy, a video the expert and the policy
    # side by side in the same episode.
    checkpoint: Path | None = None
    trust_checkpoint: bool = False  # load what the checkpoint names, without `policy check`
    window: bool = True  # open a window where there is a display; otherwise a video is written
    # of a video; a fixed one turns and zooms to hands and moved things
    camera: Literal["front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"] = "front"
    # Of a video. On one CPU core a picture costs 300 ms with shadows and anti-aliasing (`high`), 25 ms without.
    quality: Literal["observation", "high"] = "observation"
    output: Path = Path("outputs/view")  # folder of the videos


def task_view(config: TaskViewConfig) -> None:
    r"""Watch an expert, or a trained policy, at one episode.

    Where there is a display, MuJoCo's interactive viewer opens and the episode is played in real time: turn with the
    left mouse button, move with the right one, zoom with the wheel. One seed follows the other until the window is closed.

    Where there is none, or with `--window=false`, a video is written instead.

    A policy sees the cameras and the image size that its checkpoint names. LeRobot calls whatever a checkpoint's files
    name, so one that `policy check` does not pass is refused unless `--trust_checkpoint` is given.

    Examples:
        lerobot-bimanual task view --task=lift_ball
        lerobot-bimanual task view --task=handover_item --first_seed=3 --variation=2 --window=false
        lerobot-bimanual task view --task=put_bottle_in_fridge --setting=varied
        lerobot-bimanual task view --task=lift_ball --window=false --camera=left_shoulder --quality=high
        lerobot-bimanual task view --task=lift_ball --perturb=light:2,clutter:1 --window=false
        lerobot-bimanual task view --task=handover_item_easy --window=false \
            --checkpoint=results/checkpoints/peract2_on_all
    """
    check_range("first_seed", config.first_seed, 0)
    check_range("episodes", config.episodes, 1)
    reason = no_window() if config.window else "--window=false was given"
    if reason:
        # Before MuJoCo is loaded; a display may be there that does not open.
        os.environ.setdefault("MUJOCO_GL", "egl")
        check_output_folder(config.output)
    _play(config, reason)
    show_next(
        "lerobot-bimanual", "dataset", "generate", f"--task={config.task}", f"--root=data/{config.task}"
    )


def no_window() -> str:
    """Why no window can be opened; empty if one can."""
    if "DISPLAY" not in os.environ and "WAYLAND_DISPLAY" not in os.environ:
        return "there is no display"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW's own text of the same
        import glfw

        return "" if glfw.init() else "the display cannot be opened"


def _play(config: TaskViewConfig, reason: str) -> None:
    """Play in a window, or write videos if there is a reason why not."""
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import expert
    from lerobot_env_bimanual.rendering.film import rollout, write_film

    players = {"expert": expert()}
    if config.checkpoint is not None:
        from lerobot_env_bimanual.sweep.checkpoint import Checkpoint, require_safe
        from lerobot_env_bimanual.sweep.policy_rollout import policy_player

        Checkpoint.read(config.checkpoint)
        if not config.trust_checkpoint:
            require_safe(config.checkpoint)
        players["policy"] = policy_player(config.checkpoint)
    env = BimanualEnv(config.task, options=_options(config))
    if not reason:
        from lerobot_env_bimanual.viewer import watch

        watch(env, players.popitem()[1], config.first_seed)
        env.close()
        return
    print(f"{reason}, so a video of {' and '.join(players)} is written")
    for seed in range(config.first_seed, config.first_seed + config.episodes):
        rollouts = {name: rollout(env, seed, player) for name, player in players.items()}
        setting = env.options.setting.removeprefix(STANDARD)
        perturb = env.options.perturb.replace(":", "").replace(",", "_")
        episode = f"{env.task}_v{env.variation}_{config.split}_seed{seed}"
        name = "_".join(filter(None, (episode, setting, perturb, "_and_".join(players))))
        film = write_film(env, rollouts, config.output / name, config.camera)
        for name, (recording, outcome) in rollouts.items():
            verdict = "solved" if outcome.success else f"not solved: {outcome.failure}"
            print(f"{name}: {verdict} after {recording.duration_s:.1f} s")
        print(film)
    env.close()


def _options(config: TaskViewConfig) -> EnvOptions:
    """Options of the environment: what the checkpoint sees, and no images for an expert, which needs none."""
    names = ("variation", "split", "setting", "perturb")
    chosen: dict[str, Any] = {name: getattr(config, name) for name in names}
    chosen["render_quality"] = config.quality
    if config.checkpoint is None:
        return EnvOptions(obs="state", **chosen)
    from lerobot_env_bimanual.sweep.checkpoint import Checkpoint

    return EnvOptions(**chosen | Checkpoint.read(config.checkpoint).options)
