#!/usr/bin/env bash
# One policy for several tasks: it reads the instruction. Any suite is a list of tasks, too: TASKS=symmetric, or all.
set -euo pipefail
TASKS=${TASKS:-lift_ball,push_box}
EPISODES=${EPISODES:-2}
STEPS=${STEPS:-20}
OUT=${OUT:-outputs/multi_task}

# One dataset; EPISODES of each task.
lerobot-bimanual dataset generate --task="$TASKS" --episodes="$EPISODES" --view=keyframes --image_size=128 \
    --root="$OUT/dataset" --repo_id=example/tasks

lerobot-bimanual-train --dataset.repo_id=example/tasks --dataset.root="$OUT/dataset" \
    --policy.type=rvt_lf --policy.voxel_size=15 --policy.patch=3 --policy.channels=8 --policy.token_dim=16 \
    --policy.attention_dim=32 --policy.depth=2 --policy.heads=2 \
    --policy.device=cpu --policy.push_to_hub=false \
    --steps="$STEPS" --save_freq="$STEPS" --batch_size=8 --output_dir="$OUT/rvt_lf"

# Success is reported per task and over all; n_episodes is of each.
lerobot-eval --policy.path="$OUT/rvt_lf/checkpoints/last/pretrained_model" --policy.device=cpu \
    --env.type=bimanual --env.task="$TASKS" --env.image_size=128 \
    --eval.n_episodes=1 --eval.batch_size=1 --output_dir="$OUT/eval"
