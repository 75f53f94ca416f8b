"""The verb `view`: an episode before one's eyes, in MuJoCo's viewer or as a film."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_env_bimanual.options import EnvOptions


@dataclass
class TaskViewConfig(EnvOptions):
    """Flags of the verb `view`, and all options of the environment."""

    task: str = "lift_ball"  # name of one task
    seed: int = 0  # of the episode
    # Folder `pretrained_model` of a trained policy. The viewer shows the policy, a film the expert and the policy
    # beside each other, in the same episode.
    checkpoint: Path | None = None
    film: bool = False  # write a film although there is a display
    output: Path = Path("outputs/view")  # folder of the film and of its contact sheet


def task_view(config: TaskViewConfig) -> None:
    r"""Watch an expert, or a trained policy, at one episode.

    Where there is a display, MuJoCo's interactive viewer opens and the episode is played in real time: turn with the
    left mouse button, move with the right one, zoom with the wheel. Right and left arrow take the next seed and the one
    before, up and down another variation; space pauses, backspace plays again. Closing the window ends the command.

    Where there is none, or with `--film`, a film and a contact sheet are written instead.

    A policy is shown what the options say, so give those it was trained with, as to `lerobot-eval`. LeRobot calls
    whatever a checkpoint's files name: look at a stranger's with `policy check` first.

    Examples:
        lerobot-bimanual task view --task=lift_ball
        lerobot-bimanual task view --task=handover_item --seed=3 --variation=2 --film
        lerobot-bimanual task view --task=lift_ball --perturb=light:2,clutter:1 --film
        lerobot-bimanual task view --task=handover_item_easy --image_size=128 --film \
            --checkpoint=results/checkpoints/peract2_on_all
    """
    from lerobot_bimanual.output_file import check_output_folder
    from lerobot_env_bimanual.viewer import no_window

    _check(config)
    reason = "--film was given" if config.film else no_window()
    if reason:
        os.environ.setdefault(
            "MUJOCO_GL", "egl"
        )  # before MuJoCo is loaded; a display may be there that does not open
        check_output_folder(config.output)
        _film(config, reason)
    else:
        _perform(config)


def _check(config: TaskViewConfig) -> None:
    check_range("seed", config.seed, 0)
    if config.video_dir is not None or config.results_dir is not None:
        raise BimanualError(
            "view keeps no films and records of the environment: --output says where its film goes"
        )


def _film(config: TaskViewConfig, reason: str) -> None:
    from tqdm import tqdm

    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import expert
    from lerobot_env_bimanual.pictures.beside import show_beside
    from lerobot_env_bimanual.pictures.take import take

    players = {"expert": expert()}
    if config.checkpoint is not None:
        from lerobot_env_bimanual.policy_player import policy_player

        players["policy"] = policy_player(config.checkpoint)
    env = BimanualEnv(config.task, options=_shown(config))
    print(
        f"{reason}, so {' and '.join(players)} are filmed"
        if len(players) > 1
        else f"{reason}, so it is filmed"
    )
    takes = {name: take(env, config.seed, player) for name, player in players.items()}
    with tqdm(total=max(len(one.states) for one in takes.values()), desc="film", unit="picture") as bar:
        files = show_beside(env, takes, config.output, bar.update)
    env.close()
    for name, one in takes.items():
        outcome = one.outcome
        print(
            f"{name}: {'solved' if outcome.success else f'not solved: {outcome.failure}'} after {one.duration_s:.1f} s"
        )
    print("\n".join(map(str, files)))


def _perform(config: TaskViewConfig) -> None:
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import expert
    from lerobot_env_bimanual.policy_player import policy_player
    from lerobot_env_bimanual.viewer import KEYS, Performance, ShownEpisode, mujoco_window

    name, player = "expert", expert()
    if config.checkpoint is not None:
        name, player = "policy", policy_player(config.checkpoint)
    print(KEYS)
    env = BimanualEnv(config.task, options=_shown(config))
    Performance(env, player, name, ShownEpisode(config.seed), mujoco_window).run()
    env.close()


def _shown(config: TaskViewConfig) -> EnvOptions:
    """The options; an expert looks at no images, so none are drawn for it."""
    options = EnvOptions(**config.keywords())
    return options if config.checkpoint is not None else replace(options, obs="state")
