#!/usr/bin/env bash
# Certifies every task: the experts on every variation, exact and rounded, and all controls. An interrupted run goes
# on where it stopped. With SEEDS=a:b it takes other seeds than those of the committed certificates.
set -euo pipefail
cd "$(dirname "$0")/.."

seeds="${SEEDS:-61000:61100}"
few="${seeds%%:*}:$((${seeds%%:*} + 50))"
fewest="${seeds%%:*}:$((${seeds%%:*} + 20))"  # adversaries try several ways in each episode
folder="${FOLDER:-results/certificates}"

certify() {
    echo "== $1"
    .venv/bin/lerobot-bimanual certify --output="$folder/$1.json" "${@:2}" || failed="${failed:-} $1"
}

certify expert --variation=each --seeds="$seeds" --replay=joint
certify expert_discretised --variation=each --seeds="$seeds" --discretise=100
certify solo_left --control=solo_left --seeds="$fewest"
certify solo_right --control=solo_right --seeds="$fewest"
certify language_blind --control=language_blind --variation=each --seeds="$fewest" \
    --task=dual_push_buttons,put_item_in_drawer,handover_item
certify blind --control=blind --variation=each --seeds="$few"
certify random --control=random --seeds="$few"
certify noop --control=noop --seeds="$few"
.venv/bin/lerobot-bimanual report --certificates="$folder" --output=docs/tasks.md
[ -z "${failed:-}" ] || { echo "not good enough:$failed"; exit 1; }
