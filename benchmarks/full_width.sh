#!/usr/bin/env bash
# The network at its full width (66 million parameters) learns four demonstrations by heart, and then plays their placements, all by
# LeRobot's own lerobot-train and lerobot-eval, which print the loss every 20 steps and at the end how many were solved.
# Repeated, it goes on where it stopped; with more STEPS, training goes on.
# Flags go to a new training as they are:
#
#     DEVICE=cuda STEPS=2400 benchmarks/full_width.sh --policy.dtype=bfloat16
set -euo pipefail
TASK=${TASK:-lift_ball}
DEVICE=${DEVICE:-cpu}
VOXELS=${VOXELS:-50}  # per axis, a multiple of 5
STEPS=${STEPS:-400}  # in all, over repetitions
SAVE_FREQ=${SAVE_FREQ:-100}  # steps that an interruption may cost
OUT=${OUT:-outputs/full_width}
export HF_HUB_OFFLINE=1

lerobot-bimanual dataset generate --task="$TASK" --episodes=4 --image_size=128 --root="$OUT/demonstrations"

folder="$OUT/voxels$VOXELS" last="$OUT/voxels$VOXELS/checkpoints/last"
trained() { basename "$(realpath "$last")"; }
if [[ ! -e $last ]]; then
    rm -rf "$folder"  # of a training that ended before its first checkpoint
    # Hands reach other places than an expert's by up to half a voxel: scenes that are moved a little prepare for that.
    # At a constant rate, more steps go on as if they had been asked for at first.
    lerobot-train --policy.type=peract2 --policy.voxel_size="$VOXELS" --policy.device="$DEVICE" --policy.push_to_hub=false \
        --policy.augmentation_shift_m='[0.04,0.04,0.0]' --policy.augmentation_yaw_deg=0 \
        --policy.optimizer_lr=2e-4 --policy.lr_schedule=constant \
        --dataset.repo_id=local/demonstrations --dataset.root="$OUT/demonstrations" --output_dir="$folder" \
        --steps="$STEPS" --save_freq="$SAVE_FREQ" --batch_size=4 --num_workers=1 --log_freq=20 "$@"
elif ((10#$(trained) < STEPS)); then
    lerobot-train --config_path="$last/pretrained_model/train_config.json" --resume=true \
        --steps="$STEPS" --save_freq="$SAVE_FREQ"
fi
find "$folder/checkpoints" -mindepth 1 -type d -prune ! -name "$(trained)" -exec rm -r {} +  # each takes 0.8 GB

lerobot-eval --policy.path="$last/pretrained_model" --policy.device="$DEVICE" --seed=0 \
    --env.type=bimanual --env.task="$TASK" --env.image_size=128 --env.split=train \
    --eval.n_episodes=4 --eval.batch_size=4 --eval.use_async_envs=false --output_dir="$OUT/eval$(trained)"
echo "next: TASK=$TASK DEVICE=$DEVICE VOXELS=$VOXELS OUT=$OUT STEPS=$((2 * STEPS)) $0"
