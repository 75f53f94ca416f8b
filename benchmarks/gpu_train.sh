#!/usr/bin/env bash
# Train a policy on a GPU for so many minutes and score it, on a machine that has no network.
#
#   benchmarks/gpu_train.sh pack WHEELS               elsewhere, with network: put every package into a folder (3 GB)
#   benchmarks/gpu_train.sh run WHEELS MINUTES [FLAG ...]
#                                                     on the GPU machine: install them, measure how long a step takes,
#                                                     and run `lerobot-bimanual policy benchmark` with as many as fit
#
# FLAGs are those of `lerobot-bimanual policy benchmark`, all but --steps and --save_freq:
#
#   benchmarks/gpu_train.sh run wheels 30 --task=push_box
#   benchmarks/gpu_train.sh run wheels 120 --task=lift_ball --recipe=paper --train_flags="--policy.dtype=bfloat16"
#
# Demonstrations, checkpoints and the result lie in --output (outputs/gpu). The same command goes on where it stopped.
# DEVICE=cpu tries it without a GPU; PYTHON names an interpreter of the version in .python-version, if `python3.12` does
# not find it; WHEELS may be `-` where the packages are installed already.
set -euo pipefail
repository="$(cd -P "$(dirname "$0")/.." && pwd)"
measured_steps=60
log_every=20

usage() {
    sed -n '2,/^set /{/^# \{0,1\}/s///p}' "$0" >&2
    exit 2
}

pack() {
    mkdir -p "$1"
    "$repository/scripts/setup.sh"
    local python="$repository/.venv/bin/python" temporary package
    for package in . envs policies; do
        "$python" -m build --no-isolation --wheel --outdir "$1" "$repository/$package"
    done
    temporary="$(mktemp -d)"
    "$python" -m venv "$temporary"  # for its pip
    "$temporary/bin/pip" download --requirement "$repository/requirements.lock" --dest "$1"
    rm -rf "$temporary"
    cp "$repository/.python-version" "$repository/requirements.lock" "$0" "$1"
    echo "Ready: $1 ($(du -sh "$1" | cut -f1))"
}

install() {
    local environment="outputs/gpu_environment"
    if ! [[ -x $environment/bin/lerobot-bimanual ]]; then
        "${PYTHON:-python$(<"$1/.python-version")}" -m venv "$environment"
        "$environment/bin/pip" install --quiet --no-index --find-links "$1" --requirement "$1/requirements.lock"
        "$environment/bin/pip" install --quiet --no-index --no-deps "$1"/lerobot_*bimanual-*.whl
    fi
    PATH="$PWD/$environment/bin:$PATH"
}

# The command of a dry run that begins with these words, as a list in `command`.
plan() {
    eval "command=($(lerobot-bimanual policy benchmark "${flags[@]}" --dry_run=true 2>/dev/null | grep -m 1 "^$1"))"
}

# The value of one of its flags.
value_of() {
    local word
    for word in "${command[@]}"; do
        [[ $word != --"$1"=* ]] || echo "${word#*=}"
    done
}

run() {
    local wheels="$1" minutes="$2"
    shift 2
    [[ $wheels == - ]] || install "$wheels"
    flags=(--output=outputs/gpu --device="${DEVICE:-cuda}" "$@")
    lerobot-bimanual doctor
    plan "lerobot-bimanual dataset generate"
    [[ -d "$(value_of root)" ]] || "${command[@]}"
    plan "lerobot-[a-z-]*train"
    local record steps
    record="$(value_of output_dir).steps-in-$minutes-minutes"
    if ! [[ -f $record ]]; then
        echo "Measuring $measured_steps steps ..."
        local trial log
        trial="$(mktemp -d)"
        log="$("${command[@]}" --steps=$measured_steps --log_freq=$log_every --save_checkpoint=false \
            --output_dir="$trial/train" 2>&1)" || { echo "$log" >&2; exit 1; }
        rm -rf "$trial"
        mkdir -p "$(dirname "$record")"
        # The last window alone: before it, loaders start and layers are compiled.
        grep -o 'updt_s:[0-9.]* data_s:[0-9.]*' <<<"$log" | tail -1 | tr ':' ' ' |
            awk -v minutes="$minutes" '{ print int(minutes * 60 / ($2 + $4) / 4) * 4 }' >"$record"
    fi
    steps="$(<"$record")"
    ((steps > 0)) || { echo "Not even four steps fit into $minutes minutes." >&2; exit 1; }
    echo "Training $steps steps in about $minutes minutes."
    exec lerobot-bimanual policy benchmark "${flags[@]}" --steps="$steps" --save_freq=$((steps / 4))
}

case "${1:-}:$#" in
pack:2) pack "$2" ;;
run:[0-2]) usage ;;
run:*) run "${@:2}" ;;
*) usage ;;
esac
