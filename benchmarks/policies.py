"""How long policies take: training steps and actions of the small recipes, and PerAct2 beside its reference.

The reference (`examples/peract2_written_out.py`) is the method written out: it has the structure of PerAct2's published code and
computes the same function of the same weights. Both run in turns.

    python benchmarks/policies.py                               # small policies on five 128 px cameras
    python benchmarks/policies.py --reference --voxels=50       # forward and backward pass of the paper's network
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import draccus
import numpy as np
import torch
from harness import Figures, parser, report
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class

from lerobot_bimanual.benchmark.recipes import Recipe
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.pinhole import intrinsics_from_fovy
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.keypose.losses import keypose_losses
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy
from lerobot_policy_bimanual.training.program import keep_freed_memory

sys.path.append(str(Path(__file__).parents[1] / "examples"))

import peract2_written_out as reference

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


def beside_reference(voxels: int, batch_size: int, rounds: int, device: str) -> Figures:
    """Forward and backward pass of PerAct2 in the paper's size, and of its reference with the same weights."""
    config = PerAct2Config(device=device, voxel_size=voxels)
    network: Any = PerAct2Policy(config).network.eval().to(device)
    parameters = dict(network.named_parameters())
    grid = torch.rand(batch_size, 10, voxels, voxels, voxels, device=device)
    proprio = torch.rand(batch_size, 8, device=device)
    language = torch.randn(batch_size, config.language_tokens, config.language_dim, device=device)
    voxel = torch.full((batch_size, 2, 3), voxels // 2, device=device)
    classes = torch.ones(batch_size, 2, 5, dtype=torch.long, device=device)
    target = KeyposeBins(voxel, classes[..., :3], classes[..., 3], classes[..., 4])

    def ours() -> None:
        losses = keypose_losses(network(grid, proprio, language), target)
        torch.stack(list(losses.values())).sum(dim=0).mean().backward()

    def written_out() -> None:
        outputs = reference.network(parameters, grid, proprio, language, arms=2, heads=config.heads)
        reference.one_hot_loss(*outputs, voxel, classes).backward()

    network.requires_grad_(True)
    times = [[seconds(job, device) for job in (ours, written_out)] for _ in range(rounds)]
    ours_s, written_s = (min(column) for column in zip(*times, strict=True))
    return {"s": ours_s, "reference, s": written_s, "times faster": written_s / ours_s}


def main() -> None:
    arguments = parser(__doc__)
    devices = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    arguments.add_argument("--device", choices=devices, default="cpu")
    arguments.add_argument("--policies", nargs="+", default=POLICIES, metavar="TYPE")
    arguments.add_argument("--batch_size", type=int, help="by default 8, beside the reference 1")
    arguments.add_argument(
        "--reference", action="store_true", help="compare PerAct2 with its reference instead"
    )
    arguments.add_argument(
        "--voxels", type=int, default=50, help="per axis, a multiple of 5; with --reference"
    )
    options: argparse.Namespace = arguments.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    keep_freed_memory()
    if options.reference:
        figures = beside_reference(options.voxels, options.batch_size or 1, options.rounds, options.device)
        rows = {f"PerAct2, {options.voxels} voxels": figures}
    else:
        batch_size = options.batch_size or 8
        rows = {
            name: small_policy(name, batch_size, options.rounds, options.device) for name in options.policies
        }
    report(f"policies, {options.device}", rows)


if __name__ == "__main__":
    main()
