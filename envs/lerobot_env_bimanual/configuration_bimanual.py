"""LeRobot's view of the environment: `--env.type=bimanual`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.keypose import KEYPOSE_DIM

if TYPE_CHECKING:
    import gymnasium as gym

    from lerobot_env_bimanual.options import EnvOptions


@EnvConfig.register_subclass("bimanual")
@dataclass
class BimanualEnvConfig(EnvConfig):
    """Options of the bimanual environment on LeRobot's command lines.

    Args:
        task: A task, a suite (`all`, `symmetric`, `prehensile`, ...) or several of both, separated by commas.
        variation: Index of the variation, or `any` to draw one per episode.
        split: `train`, `val` or `test`: the same seed means different episodes in each. Datasets are generated
            from `train`, so an evaluation with the default never sees a demonstrated episode.
        cameras: Cameras of the observation, separated by commas.
        image_size: Side of the images in pixels, or height and width as in `480x640`.
        obs: `rgbd`, `rgb` or `state`.
        control_mode: `auto` declares joint actions and executes joint actions and keyposes alike, told apart by
            their length. LeRobot sizes a policy's output by the declared action, and this way ACT and keypose
            policies run with the same command. `joint` and `keypose` are strict.
        video_dir: Folder for a film of every episode's whole motion. (LeRobot's own videos hold one frame per
            step, which is one per keypose.)
        max_keyposes: Keyposes until an episode is truncated.
        render_quality: Of videos, `observation` or `high`; the latter costs ten times as much.
        fps: Control ticks per second; a property of the world, not a choice.
    """

    task: str | None = "push_box"
    variation: int | str = "any"
    split: str = "test"
    cameras: str = ",".join(CAMERA_NAMES)
    image_size: int | str = 256
    obs: str = "rgbd"
    control_mode: str = "auto"
    video_dir: str | None = None
    max_keyposes: int = 25
    render_quality: str = "observation"
    fps: int = schema.FPS

    def __post_init__(self):
        if self.fps != schema.FPS:
            raise InvalidChoice("fps", self.fps, [str(schema.FPS)])
        settings = self._settings()
        action_dim = KEYPOSE_DIM if self.control_mode == "keypose" else len(schema.VECTORS[schema.ACTION])
        self.features = {schema.ACTION: PolicyFeature(FeatureType.ACTION, (action_dim,))}
        self.features["agent_pos"] = PolicyFeature(FeatureType.STATE, (len(schema.VECTORS[schema.STATE]),))
        if self.obs != "state":
            image = PolicyFeature(FeatureType.VISUAL, (settings.height, settings.width, 3))
            self.features |= {schema.image_key(camera): image for camera in settings.cameras}
        self.features_map = {key: key for key in self.features} | {"agent_pos": schema.STATE}

    def _settings(self) -> EnvOptions:
        """Check the options against every selected task; MuJoCo is loaded here, not with this module."""
        from lerobot_env_bimanual.options import EnvOptions
        from lerobot_env_bimanual.tasks.registry import get_task

        settings = [EnvOptions.parse(get_task(task).spec, **self.gym_kwargs) for task in self.tasks]
        return settings[0]

    @property
    def tasks(self) -> tuple[str, ...]:
        """Names of the selected tasks."""
        from lerobot_env_bimanual.tasks.registry import resolve_tasks

        return resolve_tasks(self.task or "")

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of `BimanualEnv` besides the task."""
        return {
            "variation": self.variation,
            "split": self.split,
            "cameras": self.cameras,
            "image_size": self.image_size,
            "obs": self.obs,
            "control_mode": self.control_mode,
            "video_dir": self.video_dir,
            "max_keyposes": self.max_keyposes,
            "render_quality": self.render_quality,
        }

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, gym.vector.VectorEnv]]:
        """One vector environment per task, as `{task name: {task id: environments}}`.

        LeRobot reports success per outer key, hence one group per task; a suite's mean is LeRobot's `overall`.
        """
        from lerobot_env_bimanual.env import BimanualEnv
        from lerobot_env_bimanual.tasks.registry import get_task
        from lerobot_env_bimanual.vector import LazyVectorEnv

        asynchronous = use_async_envs and n_envs > 1
        return {
            task: {
                get_task(task).spec.id: LazyVectorEnv(
                    [partial(BimanualEnv, task, **self.gym_kwargs)] * n_envs, asynchronous=asynchronous
                )
            }
            for task in self.tasks
        }
