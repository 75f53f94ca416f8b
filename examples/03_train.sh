#!/usr/bin/env bash
# Record demonstrations and train PerAct2 on them. The tiny defaults show the commands at work in minutes; 100 episodes
# and the 1500 steps of the recipe solve lift_ball.
set -euo pipefail
TASK=${TASK:-lift_ball}
EPISODES=${EPISODES:-3}
STEPS=${STEPS:-20}
OUT=${OUT:-outputs/train}

lerobot-bimanual generate --task="$TASK" --episodes="$EPISODES" --view=keyframes --image_size=128 \
    --root="$OUT/dataset" --repo_id="example/$TASK"

# Without the sizes it is the network of the paper, for which a GPU is needed. lerobot-bimanual-train takes the same
# flags and gives the same weights, but reads the dataset only once.
lerobot-train --dataset.repo_id="example/$TASK" --dataset.root="$OUT/dataset" \
    --policy.type=peract2 --policy.voxel_size=25 --policy.translation_head=factorised --policy.channels=16 \
    --policy.token_dim=64 --policy.num_latents=128 --policy.latent_dim=128 --policy.depth=2 \
    --policy.device=cpu --policy.push_to_hub=false --num_workers=0 \
    --steps="$STEPS" --save_freq="$STEPS" --batch_size=8 --output_dir="$OUT/peract2"
