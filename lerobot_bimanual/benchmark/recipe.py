"""How much is trained on what, per policy: a laptop's `small`, and the paper's."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema

RecipeName = Literal["small", "paper"]
PolicyName = Literal["peract2", "peract_lf", "peract_independent", "rvt_lf", "act"]

ACT_CAMERAS = ("front", "left_wrist", "right_wrist")
"""What ACT sees, as RGB without depth (PerAct2 paper)."""


@dataclass(frozen=True)
class Recipe:
    """Sizes of one benchmark of one policy.

    Attributes:
        demos: Expert demonstrations.
        image_size: Side of the images in pixels.
        steps: Optimiser steps.
        batch_size: Rows of the dataset per step.
        save_freq: Steps from one checkpoint to the next.
        val_episodes: Validation episodes per checkpoint.
        test_episodes: Test episodes of the best checkpoint.
        flags: Flags of the policy, without `--policy.`; defaults for the rest.
    """

    demos: int
    image_size: int
    steps: int
    batch_size: int
    save_freq: int
    val_episodes: int
    test_episodes: int
    flags: Mapping[str, str] = field(default_factory=dict)


SMALL_HORIZON = 8
"""Keyposes over which the small policies' time feature falls from +1 to -1."""

LONG_TASKS: Mapping[str, int] = {"put_bottle_in_fridge": 10, "take_tray_out_of_oven": 11}
"""Keyposes of the experts that take more than this horizon tells apart; from its end on all steps look the same."""

FAR_TASKS = ("sweep_to_dustpan", "take_tray_out_of_oven")
"""Tasks with keyposes in the air, half a metre from all that tells where (docs/learning.md).

The PerAct family trains twice as long on them, with a head that sees that far.
"""

SMALL_KEYPOSE = {
    "decode": "expectation",
    "heads": "4",
    "attention_dropout": "0",
    "language_tokens": "8",
    "language_dim": "64",
    "keypose_horizon": str(SMALL_HORIZON),
    "augmentation_shift_m": "[0.04,0.04,0]",
    "augmentation_yaw_deg": "0",
    "optimizer_lr": "2e-3",
}
"""What the small keypose policies share.

With so few steps the paper's augmentation (12.5 cm, 45 degrees) costs more than it gives, and at 4 cm voxels the
centre of the best voxel is too coarse an answer, so the mean over its neighbours is commanded. The table never moves,
and learning that it does costs half a centimetre of height, so shifts are level.
"""

SMALL_PERACT = {
    "voxel_size": "25",
    "translation_head": "factorised",
    "voxel_cells": "5",
    "channels": "16",
    "token_dim": "64",
    "num_latents": "128",
    "latent_dim": "128",
    "depth": "2",
    "feedforward_multiplier": "2",
    **SMALL_KEYPOSE,
}
"""A PerAct network of a size that learns in minutes on a laptop's CPU; docs/learning.md tells what was tried."""

SMALL_RVT = {
    "voxel_size": "45",
    "patch": "9",
    "point_radius": "0.04",
    "heatmap_sigma_px": "1",
    "channels": "16",
    "token_dim": "64",
    "attention_dim": "128",
    "depth": "4",
    "feedforward_multiplier": "2",
    **SMALL_KEYPOSE,
}
"""An RVT network that a CPU can train: pixels of 2.2 cm, points of one pixel, 25 patches per view."""

SMALL_ACT = {
    "pretrained_backbone_weights": "null",
    "dim_model": "128",
    "n_heads": "4",
    "dim_feedforward": "256",
    "n_encoder_layers": "2",
    "chunk_size": "20",
    "n_action_steps": "20",
    "optimizer_lr": "1e-4",
}
"""An ACT that a CPU can train, with one second per chunk of actions; not tuned."""

SMALL_STEPS: Mapping[PolicyName, int] = {
    "peract2": 1_500,
    "peract_lf": 1_200,
    "peract_independent": 1_200,
    "rvt_lf": 800,
    "act": 750,
}
"""10 to 15 minutes on one core for every keypose policy, and half an hour on two cores for ACT, which reads videos."""

SMALL_FLAGS: Mapping[PolicyName, Mapping[str, str]] = {
    "peract2": SMALL_PERACT,
    "peract_lf": SMALL_PERACT,
    "peract_independent": SMALL_PERACT,
    "rvt_lf": SMALL_RVT,
    "act": SMALL_ACT,
}


def recipe_for(policy: PolicyName, name: RecipeName, task: str) -> Recipe:
    """The recipe of a policy for a task."""
    if name == "paper":
        # Iterations, their tenth as the distance of checkpoints, demonstrations, 256 pixels (PerAct2 paper);
        # the batch is that of the paper's code, the paper filled a GPU of 48 GB.
        return Recipe(100, 256, 100_000, 8, 10_000, 100, 100)
    steps, flags = SMALL_STEPS[policy], SMALL_FLAGS[policy]
    if task in LONG_TASKS and "keypose_horizon" in flags:
        flags = {**flags, "keypose_horizon": str(LONG_TASKS[task] + 1)}  # one more for the start
    if task in FAR_TASKS and "translation_head" in flags:
        steps, flags = 2 * steps, {**flags, "projection_dilations": "[3,9]"}
    return Recipe(100, 128, steps, 8, steps // 2, 20, 50, flags)


def view_of(policy: PolicyName) -> schema.View:
    """The dataset view that a policy learns from."""
    return "frames" if policy == "act" else "keyframes"


def cameras_of(policy: PolicyName) -> tuple[str, ...]:
    """The cameras that a policy looks through."""
    return ACT_CAMERAS if policy == "act" else CAMERA_NAMES


def input_flags(policy: PolicyName, image_size: int) -> dict[str, str]:
    """Flags of the policy that name its inputs, without `--policy.`.

    Keypose policies choose their inputs themselves. ACT would take every camera of the dataset, depth included,
    and fail at the first depth image.
    """
    if policy != "act":
        return {}
    image = {"type": "VISUAL", "shape": [3, image_size, image_size]}
    state = {"type": "STATE", "shape": [len(schema.VECTORS[schema.STATE])]}
    features = {schema.image_key(camera): image for camera in ACT_CAMERAS} | {schema.STATE: state}
    return {"input_features": json.dumps(features)}
