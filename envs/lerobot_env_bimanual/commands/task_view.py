"""The command `task view`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import check_range
from lerobot_bimanual.files import check_output_folder
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.options import STANDARD


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
    # Folder `pretrained_model` of a trained policy: expert and policy stand side by side in the same episode.
    checkpoint: Path | None = None
    trust_checkpoint: bool = False  # load what the checkpoint names, without `policy check`
    # a fixed one turns and zooms to hands and moved things
    camera: Literal["front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"] = "front"
    # On one CPU core a picture costs 300 ms with shadows and anti-aliasing (`high`), 25 ms without.
    quality: Literal["observation", "high"] = "observation"
    output: Path = Path("outputs/view")  # folder of the videos


def task_view(config: TaskViewConfig) -> None:
    r"""Write videos of an expert, or of a trained policy beside it, at single episodes.

    A policy sees the cameras and the image size that its checkpoint names. LeRobot calls whatever a checkpoint's files
    name, so one that `policy check` does not pass is refused unless `--trust_checkpoint` is given.

    Examples:
        lerobot-bimanual task view --task=lift_ball
        lerobot-bimanual task view --task=handover_item --first_seed=3 --variation=2
        lerobot-bimanual task view --task=put_bottle_in_fridge --setting=varied
        lerobot-bimanual task view --task=lift_ball --camera=left_shoulder --quality=high
        lerobot-bimanual task view --task=lift_ball --perturb=light:2,clutter:1
        lerobot-bimanual task view --task=handover_item_easy \
            --checkpoint=results/checkpoints/peract2_on_all
    """
    check_range("first_seed", config.first_seed, 0)
    check_range("episodes", config.episodes, 1)
    os.environ.setdefault("MUJOCO_GL", "egl")  # a display may be there that does not open
    check_output_folder(config.output)

    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import replanning
    from lerobot_env_bimanual.rendering.film import rollout, write_film
    from lerobot_env_bimanual.sweep.checkpoint import Checkpoint, require_safe

    # A policy sees what its checkpoint names; an expert needs no images.
    seen = {"obs": "state"} if config.checkpoint is None else Checkpoint.read(config.checkpoint).options
    chosen = {name: getattr(config, name) for name in ("variation", "split", "setting", "perturb")}
    options: dict[str, Any] = {"render_quality": config.quality, **chosen, **seen}
    env = BimanualEnv(config.task, **options)
    players = {"expert": replanning()}
    if config.checkpoint is not None:
        if not config.trust_checkpoint:
            require_safe(config.checkpoint)
        from lerobot_env_bimanual.sweep.policy_rollout import policy_player

        players["policy"] = policy_player(config.checkpoint)
    for seed in range(config.first_seed, config.first_seed + config.episodes):
        rollouts = {name: rollout(env, seed, player) for name, player in players.items()}
        setting = env.options.setting.removeprefix(STANDARD)
        perturb = env.options.perturb.replace(":", "").replace(",", "_")
        episode = f"{env.task}_v{env.variation}_{config.split}_seed{seed}"
        name = "_".join(filter(None, (episode, setting, perturb, "_and_".join(players))))
        film = write_film(env, rollouts, config.output / name, config.camera)
        for name, played in rollouts.items():
            verdict = "solved" if played.outcome.success else f"not solved: {played.outcome.failure}"
            print(f"{name}: {verdict} after {played.outcome.ticks / CONTROL_HZ:.1f} s")
        print(film)
    env.close()
    show_next("lerobot-bimanual", "dataset", "generate", f"--task={env.task}", f"--root=data/{env.task}")
