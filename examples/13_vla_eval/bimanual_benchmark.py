"""The tasks in vla-eval (`pip install vla-eval`), which runs a benchmark in one process and a policy in another.

The policy's server is sent `images` (camera -> uint8 RGB), `task_description` and `states` (16,): per arm, left
first, seven joints in rad and the gripper from 0 shut to 1 open. It answers with
`actions`: 16 joint targets, a tick of 50 ms, or with `control_mode: keypose` 18 numbers, a whole motion of both arms.
"""

import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.specs import GRIPPER_01, IMAGE_RGB, LANGUAGE, POSITION_ABSOLUTE, DimSpec

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidAction
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

JOINTS = DimSpec("joints", 7, "joint_positions", description="absolute targets in rad")
QUATERNION = DimSpec("rotation", 4, "quaternion_wxyz", (-1, 1))
FLAG = DimSpec("ignore_collisions", 1, "flag_01", (0, 1))
STATE = DimSpec("state", 16, "left_then_right[joints7_gripper1]", description="rad; gripper 0..1")


class BimanualBenchmark(StepBenchmark):
    """Tasks by name or suite; episode i has seed `seed + i`; `options` are those of `EnvOptions`, by name."""

    def __init__(self, tasks="all", seed=0, options=None):
        super().__init__()
        self.tasks, self.seed, self.env = resolve_tasks(tasks), seed, None
        self.options = EnvOptions.of(**({"control_mode": "joint"} | dict(options or {})))

    def get_tasks(self):
        return [{"name": task, "suite": "bimanual"} for task in self.tasks]

    def reset(self, task):
        if self.env is None or self.env.task != task["name"]:
            self.cleanup()
            self.env = BimanualEnv(task["name"], options=self.options)
        return self.env.reset(seed=self.seed + task["episode_idx"])[0]

    def step(self, action):
        try:
            observation, reward, terminated, truncated, info = self.env.step(np.ravel(action["actions"]))
        except InvalidAction as error:
            observation, reward, terminated, truncated, info = self.env.fail(str(error))
        over = terminated or truncated
        self._recorder.record_step(
            reward=reward, done=over, success=info["is_success"], failure=info["failure"]
        )
        return StepResult(observation, reward, over, info)

    def make_obs(self, raw_obs, task):
        images, words = raw_obs.get("pixels", {}), self.env.task_description
        return {"task_description": words, "states": raw_obs["agent_pos"], "images": images}

    def get_step_result(self, step_result):
        return {"success": bool(step_result.info["is_success"]), "ticks": int(step_result.info["ticks"])}

    def get_metric_keys(self):
        return {"success": "mean", "ticks": "mean"}

    def get_action_spec(self):
        arm = {"joints": JOINTS, "gripper": GRIPPER_01}
        if self.options.control_mode == "keypose":
            arm = {"position": POSITION_ABSOLUTE, "rotation": QUATERNION, "gripper": GRIPPER_01, "flag": FLAG}
        return {f"{side.value}_{part}": spec for side in ARMS for part, spec in arm.items()}

    def get_observation_spec(self):
        cameras = () if self.options.obs == "state" else self.options.camera_names
        return {"language": LANGUAGE, "state": STATE} | dict.fromkeys(cameras, IMAGE_RGB)

    def get_metadata(self):
        horizon = max(get_task(task).spec.horizon_ticks for task in self.tasks)
        return {"max_steps": horizon if self.options.control_mode == "joint" else self.options.max_keyposes}

    def cleanup(self):
        if self.env is not None:
            self.env.close()
        self.env = None
