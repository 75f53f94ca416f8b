#!/usr/bin/env bash
# Makes rows of the board: for each task, policy and training seed demonstrations, training, validation and test. An
# interrupted run goes on where it stopped, and cells of one task share its demonstrations and controls.
#
#   scripts/board.sh
#   TASKS="lift_ball push_box" POLICIES="peract2 rvt_lf" SEEDS="1000 2000" scripts/board.sh
#   scripts/board.sh --trained_on=all --steps=18000    any flag of `lerobot-bimanual policy benchmark`, for all cells
#
# A cell takes about eight minutes of a core. Rows go to results/leaderboard when all are there, and the pages are written.
set -euo pipefail
cd "$(dirname "$0")/.."

bimanual=.venv/bin/lerobot-bimanual
tasks="${TASKS:-$($bimanual task list --format=json | .venv/bin/python -c 'import json, sys; print(*(task["name"] for task in json.load(sys.stdin)))')}"
output="${OUTPUT:-outputs/board}"
rows="${ROWS:-results/leaderboard}"
page="${PAGE:-docs/results.md}"

fail() {  # go on with the others, unless this one was interrupted
    [ "$1" -ne 130 ] && [ "$1" -ne 143 ] || exit "$1"
    failed="${failed:-} $2"
}

for task in $tasks; do
    for policy in ${POLICIES:-peract2}; do
        for seed in ${SEEDS:-1000}; do
            echo "== $task, $policy, training seed $seed"
            # Seeds that no earlier weights have played.
            $bimanual policy benchmark --task="$task" --policy="$policy" --seed="$seed" --device=cpu --workers="${WORKERS:-0}" \
                --first_seed=4000000 --output="$output" "$@" || fail $? "$task/$policy/$seed"
        done
    done
done
[ -z "${failed:-}" ] || { echo "without a row:$failed; the same command goes on"; exit 1; }
mkdir -p "$rows"
cp "$output"/results/*.json "$rows"
$bimanual results report --results="$rows" --output="$page"
[ "$page" != docs/results.md ] || .venv/bin/python scripts/tables.py  # the first page shows the same table
