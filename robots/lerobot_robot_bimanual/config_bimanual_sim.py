"""LeRobot's `--robot.type=bimanual_sim`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.robots.config import RobotConfig

from lerobot_env_bimanual.options import ANY_VARIATION, EnvOptions, checked_seed


@RobotConfig.register_subclass("bimanual_sim")
@dataclass(kw_only=True)
class BimanualSimConfig(RobotConfig):
    """Two simulated arms in front of one task.

    Raises:
        InvalidChoice: there is no such task; the message lists all.
        BimanualError: another option is outside its choices.
    """

    # Name of the task.
    task: str = "push_box"
    # Index of the variation of every episode, or `any` to draw one per episode.
    variation: int | str = ANY_VARIATION
    # `train`, `val` or `test`: the same seed means different episodes in each. The default keeps recorded episodes apart
    # from those of evaluations, which are on `test`.
    split: str = "train"
    # `standard`, or `varied`, where sizes, heights and places of things differ more.
    setting: str = EnvOptions.setting
    # Seed of the first episode; every further one has the next.
    seed: int = 0
    # Perturbations of the nominal world, as `AXIS:LEVEL`, several separated by commas.
    perturb: str = EnvOptions.perturb
    # Cameras of the observation, separated by commas. (Not LeRobot's cameras: these need no address.)
    cameras: str = EnvOptions.cameras
    # Side of the images in pixels, or height and width as in `480x640`.
    image_size: int | str = EnvOptions.image_size
    # `rgb`, `rgbd` (also depth in millimetres) or `state` (no images).
    obs: str = "rgb"
    # Off: an action is one tick of 50 ms, and the same actions lead to the same state, bit for bit. On: the simulation
    # follows the clock, and repeats the last action until the next one.
    real_time: bool = False
    # Folder for a video of every episode.
    video_dir: str | None = None

    def __post_init__(self) -> None:
        """Check everything; LeRobot has a check of its own, but of real cameras. MuJoCo is loaded here."""
        from lerobot_env_bimanual.tasks.registry import get_task

        get_task(self.task).spec.variation_index(self.variation)
        checked_seed(self.seed)
        self.env_options()

    def env_options(self) -> EnvOptions:
        """These options as those of the environment."""
        return EnvOptions(
            variation=self.variation,
            split=self.split,
            setting=self.setting,
            perturb=self.perturb,
            cameras=self.cameras,
            image_size=self.image_size,
            obs=self.obs,
            video_dir=self.video_dir,
        )
