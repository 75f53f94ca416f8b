#!/usr/bin/env bash
# Score a policy on unseen placements, keep a record of every action, and set it beside the expert and the blind control.
set -euo pipefail
TASK=${TASK:-handover_item_easy}
POLICY=${POLICY:-results/checkpoints/peract2_on_all}
EPISODES=${EPISODES:-4}
SEED=${SEED:-1000}
SEEDS=${SEEDS:-$SEED:$((SEED + EPISODES))}
OUT=${OUT:-outputs/evaluate}

# A stranger's checkpoint is looked at before anything loads it.
lerobot-bimanual policy check --checkpoint="$POLICY"

# Images as in training; films of the whole motion, and records of every action.
lerobot-eval --policy.path="$POLICY" --policy.device=cpu --seed="$SEED" \
    --env.type=bimanual --env.task="$TASK" --env.image_size=128 \
    --env.video_dir="$OUT/films" --env.results_dir="$OUT/records" \
    --eval.n_episodes="$EPISODES" --eval.batch_size=2 --output_dir="$OUT/eval"

# The same placements without any policy: what the scripts score that see the scene, and that do not.
lerobot-bimanual expert evaluate --task="$TASK" --seeds="$SEEDS" --output="$OUT/expert.json"
lerobot-bimanual expert evaluate --task="$TASK" --seeds="$SEEDS" --control=blind --output="$OUT/blind.json" ||
    echo "the blind control scores more than it should; on few episodes that happens"

# The first of them as a video and in pictures, the policy beside the expert.
lerobot-bimanual task view --task="$TASK" --first_seed="$SEED" --image_size=128 --checkpoint="$POLICY" --video --output="$OUT/view"
