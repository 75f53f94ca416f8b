"""How long policies take: training steps and actions of the small recipes, on five cameras of 128 pixels.

python benchmarks/policies.py
"""

import argparse
import json
import time
from collections.abc import Callable
from typing import Any

import draccus
import numpy as np
import torch
from harness import Figures, parser, report
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class

import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies
from lerobot_bimanual.benchmark.recipes import Recipe
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_policy_bimanual.training.program import keep_freed_memory

type Job = Callable[[], object]
POLICIES = ("peract2", "peract_lf", "peract_independent", "rvt_lf")


def seconds(job: Job, device: str) -> float:
    """CPU seconds of a call, or those of the clock on a GPU."""
    clock = time.process_time if device == "cpu" else time.perf_counter
    start = clock()
    job()
    if device != "cpu":
        torch.cuda.synchronize()
    return clock() - start


def random_batch(samples: int, image_size: int, device: str) -> dict[str, Any]:
    """Five cameras that look down on noise, with labels."""
    batch: dict[str, Any] = {}
    for camera in CAMERA_NAMES:
        batch[schema.image_key(camera)] = torch.rand(samples, 3, image_size, image_size)
        batch[schema.depth_key(camera)] = 500 + 1500 * torch.rand(samples, 1, image_size, image_size)
    pose = torch.tensor([[0.0, -1, 0, 0.2], [-1, 0, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]])
    intrinsics = torch.tensor(intrinsics_from_fovy(np.pi / 3, image_size, image_size)).float()
    batch[schema.CAMERA_EXTRINSICS] = pose.repeat(samples, 5, 1, 1).flatten(1)
    batch[schema.CAMERA_INTRINSICS] = intrinsics.repeat(samples, 5, 1, 1).flatten(1)
    batch[schema.STATE] = torch.rand(samples, 16)
    batch[schema.GRIPPER_FINGERS] = 0.04 * torch.rand(samples, 4)
    batch[schema.KEYPOSE_STEP] = torch.zeros(samples, 1)
    batch[schema.ACTION] = torch.tensor([0.2, 0.1, 1, 0, 1, 0, 0, 1, 0] * 2).repeat(samples, 1)
    return {key: value.to(device) for key, value in batch.items()} | {"task": ["lift the ball"] * samples}


def small_policy(name: str, batch_size: int, rounds: int, device: str) -> Figures:
    """A training step of a small recipe, and one action."""
    section = Recipe.find(name, "small").sections["policy"]
    flags = [f"--{option}={json.dumps(value)}" for option, value in section.items() if option != "type"]
    config = draccus.parse(PreTrainedConfig.get_choice_class(name), args=[*flags, f"--device={device}"])
    policy: Any = get_policy_class(name)(config).to(device).train()
    optimizer: Any = config.get_optimizer_preset().build(policy.get_optim_params())
    batch, observation = random_batch(batch_size, 128, device), random_batch(1, 128, device)

    def step() -> None:
        loss, _ = policy(batch)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), config.optimizer_grad_clip_norm)
        optimizer.step()

    step()
    step_s = min(seconds(step, device) for _ in range(rounds))
    policy.eval()
    action_s = min(seconds(lambda: policy.select_action(observation), device) for _ in range(rounds))
    return {"training step, s": step_s, "samples per s": batch_size / step_s, "action, s": action_s}


def main() -> None:
    arguments = parser(__doc__)
    devices = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    arguments.add_argument("--device", choices=devices, default="cpu")
    arguments.add_argument("--policies", nargs="+", default=POLICIES, metavar="TYPE")
    arguments.add_argument("--batch_size", type=int, default=8)
    options: argparse.Namespace = arguments.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    keep_freed_memory()
    rows = {
        name: small_policy(name, options.batch_size, options.rounds, options.device)
        for name in options.policies
    }
    report(f"policies, {options.device}", rows)


if __name__ == "__main__":
    main()
