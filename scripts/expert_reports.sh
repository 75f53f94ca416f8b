#!/usr/bin/env bash
# Evaluates the experts on every variation, exact and rounded, and all baselines, in both settings, and writes docs/tasks.md;
# then the experts in every perturbed condition, which takes many hours. An interrupted run continues where it stopped: tasks
# that a report has, of the same world, are not played again. With FIRST_SEED=n it takes other seeds than those of the
# committed reports.
set -euo pipefail
cd "$(dirname "$0")/.."

first="${FIRST_SEED:-62000}" folder="${FOLDER:-results/expert_reports}"
ambiguous=dual_push_buttons,put_item_in_drawer,handover_item  # tasks whose scenes allow several instructions

evaluate() {  # NAME FLAGS, in both settings; continue with the others after violations, but not after an interrupt
    for setting in standard varied; do
        echo "== $setting: $1"
        .venv/bin/lerobot-bimanual expert evaluate --setting=$setting --output="$folder/$setting/$1.json" \
            --first_seed="$first" "${@:2}" || {
            local code=$?
            [ $code -eq 1 ] || exit $code
            failed="${failed:-} $setting/$1"
        }
    done
}

evaluate expert --variation=each --replay=joint
evaluate expert_discretised --variation=each --discretise=100
evaluate nearest --player=nearest --episodes=50
evaluate open_loop --player=open_loop --variation=each --episodes=50
evaluate language_ablated --player=language_ablated --variation=each --episodes=20 --task="$ambiguous"
evaluate random --player=random --episodes=50
evaluate noop --player=noop --episodes=50
.venv/bin/lerobot-bimanual expert report --expert_reports="$folder" --output=docs/tasks.md
.venv/bin/lerobot-bimanual expert evaluate --axes=all --output="$folder/perturbed" --first_seed="$first"
.venv/bin/lerobot-bimanual expert report --expert_reports="$folder" --output=docs/tasks.md
[ -z "${failed:-}" ] || { echo "violations:$failed"; exit 1; }
