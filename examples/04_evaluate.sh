#!/usr/bin/env bash
# Score a policy on unseen placements, keep a record of every action, and compare it with the expert and the open-loop baseline.
set -euo pipefail
TASK=${TASK:-handover_item_easy}
POLICY=${POLICY:-results/checkpoints/peract2_on_all}
EPISODES=${EPISODES:-4}
SEED=${SEED:-1000}
OUT=${OUT:-outputs/evaluate}

# Check a stranger's checkpoint before anything loads it.
lerobot-bimanual policy check --checkpoint="$POLICY"

# Images as in training; videos of the whole motion, and records of every action.
lerobot-eval --policy.path="$POLICY" --policy.device=cpu --seed="$SEED" \
    --env.type=bimanual --env.task="$TASK" --env.image_size=128 \
    --env.video_dir="$OUT/videos" --env.results_dir="$OUT/records" \
    --eval.n_episodes="$EPISODES" --eval.batch_size=2 --output_dir="$OUT/eval"

# The same placements without any policy: the expert sees the scene's state, the open-loop baseline does not.
lerobot-bimanual expert evaluate --task="$TASK" --first_seed="$SEED" --episodes="$EPISODES" --output="$OUT/expert.json"
lerobot-bimanual expert evaluate --task="$TASK" --first_seed="$SEED" --episodes="$EPISODES" --player=open_loop --output="$OUT/open_loop.json" ||
    echo "the open-loop baseline scores more than it should, which happens on few episodes"

# The first of them as a video, the policy beside the expert.
lerobot-bimanual task view --task="$TASK" --first_seed="$SEED" --checkpoint="$POLICY" --output="$OUT/view"
