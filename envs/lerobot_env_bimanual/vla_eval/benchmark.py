"""vla-eval's side of the environment: its tasks, what a model server is sent, and what it has to send back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.render import apply_env
from vla_eval.specs import GRIPPER_01, IMAGE_RGB, LANGUAGE, POSITION_ABSOLUTE, DimSpec
from vla_eval.types import Action, EpisodeResult, Observation, Task

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidAction, InvalidChoice
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.actions import real_vector
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

JOINTS = DimSpec("joints", 7, "joint_positions", description="absolute targets in rad, one tick of 50 ms")
QUATERNION = DimSpec("rotation", 4, "quaternion_wxyz", (-1, 1))
IGNORE_COLLISIONS = DimSpec("ignore_collisions", 1, "flag_01", (0, 1))
STATE = DimSpec(
    "state",
    len(schema.VECTORS[schema.STATE]),
    "left_then_right[joints7_gripper1]",
    description="measured joints in rad; grippers from 0 closed to 1 open",
)
DEPTH = DimSpec("depth", 0, "depth_hw_float32_mm", description="along the optical axis")
CAMERA = DimSpec("camera", 0, "opencv_matrices", description="world_T_camera (4, 4) and intrinsics (3, 3)")


class BimanualBenchmark(StepBenchmark):
    """Tasks for two Franka arms.

    The model server is sent `images` (camera -> uint8 RGB), `task_description` and `states` (16,); of `obs=rgbd` also
    `depths` (camera -> float32 mm), `camera_extrinsics` (camera -> (4, 4)), `camera_intrinsics` (camera -> (3, 3)) and
    `ee_pose` (14,). It answers with `actions`: with `control_mode=joint` a tick, 16 numbers, with `control_mode=keypose`
    a whole motion, 18 numbers. The left arm stands before the right one. An action whose values cannot be executed
    ends its episode as a failure; one of another length is a mistake of the configuration, and an error.

    Args:
        tasks: names and suites, comma separated.
        seed: of the first episode of every task; the others count up.
        options: of `lerobot_env_bimanual.options.EnvOptions`, by name. `control_mode` must be `joint` or `keypose`,
            as the harness compares what a server declares with what is declared here.

    Raises:
        BimanualError: a task or an option does not exist.
    """

    render_backends = frozenset({"gpu", "cpu"})

    def __init__(self, tasks: str = "all", seed: int = 0, options: Mapping[str, Any] | None = None):
        super().__init__()
        self.tasks = resolve_tasks(tasks)
        self.seed = seed
        self.options = EnvOptions.of(**({"control_mode": "joint"} | dict(options or {})))
        if self.options.control_mode == "auto":
            raise InvalidChoice("control_mode", "auto", ["joint", "keypose"])
        self._env: BimanualEnv | None = None

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """EGL in both modes; without a GPU it is Mesa's."""
        return apply_env({"MUJOCO_GL": "egl"} | ({"MUJOCO_EGL_DEVICE_ID": "0"} if mode == "cpu" else {}))

    def get_tasks(self) -> list[Task]:
        """The tasks by name."""
        return [{"name": task, "suite": "bimanual"} for task in self.tasks]

    def reset(self, task: Task) -> Any:
        """Start the episode that the harness asks for; a world stays compiled as long as its task stays."""
        if self._env is None or self._env.task != task["name"]:
            self.cleanup()
            self._env = BimanualEnv(task["name"], options=self.options)
        observation, _ = self._env.reset(seed=self.seed + task["episode_idx"])
        return observation

    def step(self, action: Action) -> StepResult:
        """Execute a joint action or a keypose."""
        env = self._running
        vector = real_vector(np.ravel(action["actions"]), env.action_lengths)
        try:
            observation, reward, terminated, truncated, info = env.step(vector)
        except InvalidAction as error:
            observation, reward, terminated, truncated, info = env.fail(str(error))
        self._recorder.record_step(
            reward=reward, done=terminated or truncated, success=info["is_success"], failure=info["failure"]
        )
        return StepResult(observation, reward, terminated or truncated, info)

    def make_obs(self, raw_obs: Any, task: Task) -> Observation:
        """What the model server is sent."""
        observation: Observation = {
            "task_description": self._running.task_description,
            "states": raw_obs["agent_pos"],
            "images": raw_obs.get("pixels", {}),
        }
        if self.options.obs == "rgbd":
            cameras = self.options.camera_names
            observation |= {
                "depths": {camera: raw_obs[f"images.{camera}_depth"][0] for camera in cameras},
                "camera_extrinsics": _of(cameras, raw_obs["camera_extrinsics"].reshape(-1, 4, 4)),
                "camera_intrinsics": _of(cameras, raw_obs["camera_intrinsics"].reshape(-1, 3, 3)),
                "ee_pose": raw_obs["ee_pose"],
            }
        return observation

    def get_step_result(self, step_result: StepResult) -> EpisodeResult:
        """Whether the episode was solved when it ended."""
        info = step_result.info
        return {"success": bool(info.get("is_success", False)), "ticks": int(info.get("ticks", 0))}

    def get_metric_keys(self) -> dict[str, str]:
        """Share of solved episodes, and their mean length in ticks of 50 ms."""
        return {"success": "mean", "ticks": "mean"}

    def get_action_spec(self) -> dict[str, DimSpec]:
        """The parts of an action, in order."""
        if self.options.control_mode == "joint":
            arm = {"joints": JOINTS, "gripper": GRIPPER_01}
        else:
            arm = {"position": POSITION_ABSOLUTE, "rotation": QUATERNION, "gripper": GRIPPER_01}
            arm["ignore_collisions"] = IGNORE_COLLISIONS
        return {f"{side.value}_{part}": spec for side in ARMS for part, spec in arm.items()}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        """The parts of an observation."""
        spec = {"language": LANGUAGE, "state": STATE}
        if self.options.obs != "state":
            spec |= dict.fromkeys(self.options.camera_names, IMAGE_RGB)
        if self.options.obs == "rgbd":
            spec |= {f"{camera}_depth": DEPTH for camera in self.options.camera_names} | {"cameras": CAMERA}
        return spec

    def get_metadata(self) -> dict[str, Any]:
        """Steps until the longest task is cut; each is cut by itself before."""
        horizon = max(get_task(task).spec.horizon_ticks for task in self.tasks)
        joint = self.options.control_mode == "joint"
        return {"max_steps": horizon if joint else self.options.max_keyposes}

    def cleanup(self) -> None:
        """Free the world."""
        if self._env is not None:
            self._env.close()
            self._env = None

    def render(self) -> np.ndarray | None:
        """The front camera at 480x640, uint8 RGB."""
        return None if self._env is None else self._env.render()

    @property
    def _running(self) -> BimanualEnv:
        if self._env is None:
            raise gym.error.ResetNeeded("no episode was started")
        return self._env


def _of(cameras: Sequence[str], matrices: np.ndarray) -> dict[str, np.ndarray]:
    """The matrices of the chosen cameras; an observation has those of all five."""
    return {camera: matrices[CAMERA_NAMES.index(camera)] for camera in cameras}
