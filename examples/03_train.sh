#!/usr/bin/env bash
# Record demonstrations and train PerAct2 on them, from the repository's root. The tiny defaults show the commands at work
# in minutes; EPISODES=100 and STEPS=1500, the recipe's number, solve lift_ball.
set -euo pipefail
TASK=${TASK:-lift_ball}
EPISODES=${EPISODES:-3}
STEPS=${STEPS:-20}
OUT=${OUT:-outputs/train}
RECIPE=${RECIPE:-policies/lerobot_policy_bimanual/peract2/recipes/small.yaml}

lerobot-bimanual dataset generate --task="$TASK" --episodes="$EPISODES" --view=keyframes --image_size=128 \
    --root="$OUT/dataset" --repo_id="example/$TASK"

# The recipe is the network's sizes and all else that it learns with. Without it, `--policy.type=peract2` is the network
# of the paper, for which a GPU is needed. lerobot-bimanual-train takes the same flags and gives the same weights on a
# CPU, but reads the dataset only once.
lerobot-train --config_path="$RECIPE" --dataset.repo_id="example/$TASK" --dataset.root="$OUT/dataset" \
    --policy.device=cpu --num_workers=0 --steps="$STEPS" --save_freq="$STEPS" --output_dir="$OUT/peract2"
