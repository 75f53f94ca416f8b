#!/usr/bin/env bash
# Demonstrations, PerAct2 and LeRobot's ACT on the same data, each scored on unseen placements.
# The tiny defaults show the commands at work in minutes; raise EPISODES and STEPS for a policy that solves the task.
set -euo pipefail
TASK=${TASK:-lift_ball}
EPISODES=${EPISODES:-3}
STEPS=${STEPS:-20}
OUT=${OUT:-outputs/example}

lerobot-bimanual generate --task="$TASK" --episodes="$EPISODES" --view=both --image_size=128 \
    --root="$OUT/dataset" --repo_id="example/$TASK"

# PerAct2 learns from keyframes. Drop the size flags for the network of the paper (a GPU is then needed).
lerobot-train --dataset.repo_id="example/$TASK" --dataset.root="$OUT/dataset/keyframes" \
    --policy.type=peract2 --policy.voxel_size=25 --policy.translation_head=factorised --policy.channels=16 \
    --policy.token_dim=64 --policy.num_latents=128 --policy.latent_dim=128 --policy.depth=2 \
    --policy.device=cpu --policy.push_to_hub=false --num_workers=0 \
    --steps="$STEPS" --batch_size=8 --output_dir="$OUT/peract2"

# ACT learns joint actions from every frame. It takes RGB only, so its inputs are named.
lerobot-train --dataset.repo_id="example/$TASK" --dataset.root="$OUT/dataset/frames" \
    --policy.type=act --policy.pretrained_backbone_weights=null \
    --policy.input_features='{"observation.images.front":{"type":"VISUAL","shape":[3,128,128]},"observation.images.left_wrist":{"type":"VISUAL","shape":[3,128,128]},"observation.images.right_wrist":{"type":"VISUAL","shape":[3,128,128]},"observation.state":{"type":"STATE","shape":[16]}}' \
    --policy.dim_model=64 --policy.n_heads=2 --policy.dim_feedforward=128 \
    --policy.chunk_size=10 --policy.n_action_steps=10 \
    --policy.device=cpu --policy.push_to_hub=false --num_workers=0 \
    --steps="$STEPS" --batch_size=4 --output_dir="$OUT/act"

# One environment scores both: it takes keyposes (18 numbers) and joint actions (16 numbers).
for policy in peract2 act; do
    lerobot-eval --policy.path="$OUT/$policy/checkpoints/last/pretrained_model" --policy.device=cpu \
        --env.type=bimanual --env.task="$TASK" --env.image_size=128 \
        --eval.n_episodes=2 --eval.batch_size=2 --output_dir="$OUT/eval_$policy"
done
