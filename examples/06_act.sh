#!/usr/bin/env bash
# LeRobot's own ACT on the same tasks. It learns joint actions from every tick, and takes every image for colours, so the
# dataset is recorded without depth. Diffusion and VLAs train on this dataset likewise.
set -euo pipefail
TASK=${TASK:-lift_ball}
EPISODES=${EPISODES:-2}
STEPS=${STEPS:-20}
OUT=${OUT:-outputs/act}

lerobot-bimanual dataset generate --task="$TASK" --episodes="$EPISODES" --view=frames --depth=false --image_size=128 \
    --cameras=front,left_wrist,right_wrist --root="$OUT/dataset" --repo_id="example/$TASK"

# Without the sizes it is ACT as published: hours on a CPU.
lerobot-train --dataset.repo_id="example/$TASK" --dataset.root="$OUT/dataset" \
    --policy.type=act --policy.pretrained_backbone_weights=null \
    --policy.dim_model=64 --policy.n_heads=2 --policy.dim_feedforward=128 \
    --policy.chunk_size=10 --policy.n_action_steps=10 \
    --policy.device=cpu --policy.push_to_hub=false --num_workers=0 \
    --steps="$STEPS" --save_freq="$STEPS" --batch_size=4 --output_dir="$OUT/act"

# The environment tells actions apart by their length: 16 numbers are joints, 18 a keypose.
lerobot-eval --policy.path="$OUT/act/checkpoints/last/pretrained_model" --policy.device=cpu \
    --env.type=bimanual --env.task="$TASK" --env.image_size=128 --env.obs=rgb \
    --env.cameras=front,left_wrist,right_wrist \
    --eval.n_episodes=1 --eval.batch_size=1 --output_dir="$OUT/eval"
