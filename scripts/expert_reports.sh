#!/usr/bin/env bash
# Evaluates the experts on every variation, exact and rounded, and all baselines, and writes docs/tasks.md. An interrupted
# run continues where it stopped. With FIRST_SEED=n it takes other seeds than those of the committed reports.
set -euo pipefail
cd "$(dirname "$0")/.."

first="${FIRST_SEED:-61000}" folder="${FOLDER:-results/expert_reports}"
ambiguous=dual_push_buttons,put_item_in_drawer,handover_item  # tasks whose scenes allow several instructions

evaluate() {  # continue with the others after violations, but not after an interrupt
    echo "== $1"
    .venv/bin/lerobot-bimanual expert evaluate --output="$folder/$1.json" --first_seed="$first" "${@:2}" || {
        local code=$?
        [ $code -eq 1 ] || exit $code
        failed="${failed:-} $1"
    }
}

evaluate expert --variation=each --replay=joint
evaluate expert_discretised --variation=each --discretise=100
evaluate language_ablated --player=language_ablated --variation=each --episodes=20 --task="$ambiguous"
evaluate open_loop --player=open_loop --variation=each --episodes=50
evaluate random --player=random --episodes=50
evaluate noop --player=noop --episodes=50
.venv/bin/lerobot-bimanual expert evaluate --axes=all --output="$folder/perturbed" --first_seed="$first"
.venv/bin/lerobot-bimanual expert report --expert_reports="$folder" --output=docs/tasks.md
[ -z "${failed:-}" ] || { echo "violations:$failed"; exit 1; }
