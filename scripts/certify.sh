#!/usr/bin/env bash
# Certifies every task: the experts on every variation, exact and rounded, and all controls. An interrupted run goes
# on where it stopped. With SEEDS=a:b it takes other seeds than those of the committed certificates. With TASK=name it
# certifies that one alone, whose world has changed, and puts it into the certificates that are there.
set -euo pipefail
cd "$(dirname "$0")/.."

seeds="${SEEDS:-61000:61100}"
few="${seeds%%:*}:$((${seeds%%:*} + 50))"
fewest="${seeds%%:*}:$((${seeds%%:*} + 20))"
folder="${FOLDER:-results/certificates}"

fail() {  # go on with the others, unless somebody has stopped this one
    [ "$1" -ne 130 ] && [ "$1" -ne 143 ] || exit "$1"
    failed="${failed:-} $2"
}

certify() {
    echo "== $1"
    if [ -z "${TASK:-}" ]; then
        .venv/bin/lerobot-bimanual expert evaluate --output="$folder/$1.json" "${@:2}" || fail $? "$1"
        return
    fi
    local renewed="$folder/renewed/$1.json"
    .venv/bin/lerobot-bimanual expert evaluate --output="$renewed" "${@:2}" || fail $? "$1"
    .venv/bin/python scripts/renew_certificate.py "$folder/$1.json" "$renewed"
    rm "$renewed"
    rmdir --ignore-fail-on-non-empty "$folder/renewed"
}

ambiguous=dual_push_buttons,put_item_in_drawer,handover_item  # whose scenes allow several instructions

certify expert --task="${TASK:-all}" --variation=each --seeds="$seeds" --replay=joint
certify expert_discretised --task="${TASK:-all}" --variation=each --seeds="$seeds" --discretise=100
case ",$ambiguous," in
    *",${TASK:-$ambiguous},"*)
        certify language_blind --control=language_blind --variation=each --seeds="$fewest" \
            --task="${TASK:-$ambiguous}" ;;
esac
certify blind --task="${TASK:-all}" --control=blind --variation=each --seeds="$few"
certify random --task="${TASK:-all}" --control=random --seeds="$few"
certify noop --task="${TASK:-all}" --control=noop --seeds="$few"
.venv/bin/lerobot-bimanual expert report --certificates="$folder" --output=docs/tasks.md
[ -z "${failed:-}" ] || { echo "not good enough:$failed"; exit 1; }
