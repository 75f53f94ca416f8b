"""LeRobot's view of the environment: `--env.type=bimanual`."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

from lerobot_bimanual.cli.lerobot_flags import program_name
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import CONTROL_HZ, JOINT_ACTION_DIM
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_env_bimanual.options import EnvOptions

if TYPE_CHECKING:  # Gymnasium's vector environments are slow to import
    import gymnasium as gym
    from lerobot.processor import PolicyProcessorPipeline

    from lerobot_env_bimanual.vector.evaluation import Evaluation


@EnvConfig.register_subclass("bimanual")
@dataclass
class BimanualEnvConfig(EnvOptions, EnvConfig):
    """Options of the bimanual environment on LeRobot's command lines: those of `EnvOptions`, and two of LeRobot's."""

    # A task, a suite (`all`, `symmetric`, `prehensile`, ...) or several of both, separated by commas.
    task: str | None = "push_box"
    # Control ticks per second; a property of the world, not a choice.
    fps: int = CONTROL_HZ

    def __post_init__(self) -> None:
        """Check the options against every selected task; MuJoCo is loaded here, not with this module."""
        from lerobot_env_bimanual.episode.observations import PIXELS, dataset_key, observation_space
        from lerobot_env_bimanual.tasks.registry import get_task

        super().__post_init__()
        if self.results_dir is not None and program_name() in ("lerobot-train", "lerobot-bimanual-train"):
            choices = (
                "given to `lerobot-eval` alone: evaluations of a training are of one policy after another"
            )
            raise InvalidChoice("results_dir", self.results_dir, choices)
        if self.fps != CONTROL_HZ:
            raise InvalidChoice("fps", self.fps, [str(CONTROL_HZ)])
        counts = Counter(task for tasks in self.groups.values() for task in tasks)
        for task in counts:
            get_task(task).spec.variation_index(self.variation)
        if shared := [task for task, count in counts.items() if count > 1]:
            raise InvalidChoice("task", self.task, f"suites and tasks that share no task, as these {shared}")
        action_dim = KEYPOSE_DIM if self.control_mode == "keypose" else JOINT_ACTION_DIM
        space: dict[str, Any] = dict(observation_space(self))
        images = {schema.image_key(camera): box for camera, box in dict(space.pop(PIXELS, {})).items()}
        self.features = {schema.ACTION: PolicyFeature(FeatureType.ACTION, (action_dim,))}
        for key, box in (space | images).items():
            kind = FeatureType.VISUAL if len(box.shape) == 3 else FeatureType.STATE
            self.features[key] = PolicyFeature(kind, box.shape)
        self.features_map = {key: dataset_key(key) for key in self.features}

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Tasks of each selected suite; a task that was selected by its own name is a group of one."""
        from lerobot_env_bimanual.tasks.registry import resolve_tasks

        return {name: resolve_tasks(name) for name in map(str.strip, (self.task or "").split(","))}

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of `BimanualEnv` besides the task."""
        return self.keywords() | {"results_dir": None}

    def get_env_processors(self) -> tuple[PolicyProcessorPipeline, PolicyProcessorPipeline]:
        """LeRobot's processors: none for observations, and one for actions, which rounds joint actions."""
        from lerobot.processor import PolicyProcessorPipeline

        from lerobot_env_bimanual.processor_bimanual import RoundJointActions

        return PolicyProcessorPipeline(steps=[]), PolicyProcessorPipeline(steps=[RoundJointActions()])

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, gym.vector.VectorEnv]]:
        """One vector environment per task, as `{suite: {number in the suite: environments}}`, 0 for a task by its own name.

        Raises:
            BimanualError: `results_dir` holds another evaluation, or `lerobot-eval` is told to record this one itself.
        """
        from lerobot_env_bimanual.vector.lerobot_evaluation import evaluation_of_program

        evaluation = evaluation_of_program()
        return {
            group: {
                number: self.make_vector_env(task, n_envs, use_async_envs, evaluation)
                for number, task in enumerate(tasks)
            }
            for group, tasks in self.groups.items()
        }

    def make_vector_env(
        self, task: str, n_envs: int, use_async_envs: bool, evaluation: Evaluation
    ) -> gym.vector.VectorEnv:
        """The vector environment of one of the tasks; if asynchronous, each environment has a process of its own."""
        from lerobot_env_bimanual.env import BimanualEnv
        from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

        make = partial(BimanualEnv, task, **self.gym_kwargs)
        return LazyVectorEnv(
            [make] * n_envs,
            asynchronous=use_async_envs and n_envs > 1,
            evaluation=evaluation,
            results_dir=self.results_dir,
        )
