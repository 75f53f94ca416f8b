#!/usr/bin/env bash
# Train a policy for some minutes on a GPU machine without network, and score it.
#
#   benchmarks/gpu_train.sh pack WHEELS                     with network: put every package into a folder (3 GB)
#   benchmarks/gpu_train.sh run WHEELS MINUTES [FLAG ...]   on the GPU machine: install them, measure how long a step
#                                  takes, and run `lerobot-bimanual policy benchmark` with as many steps as fit
#
# FLAGs are those of `lerobot-bimanual policy benchmark` except --steps and --save_freq, such as --task=lift_ball --recipe=paper.
# Everything is written to --output (outputs/gpu); the same command resumes. WHEELS may be `-` where the packages are
# installed. DEVICE=cpu tries it without a GPU; PYTHON names the interpreter.
set -euo pipefail
repository="$(cd -P "$(dirname "$0")/.." && pwd)"

pack() {
    mkdir -p "$1"
    "$repository/scripts/setup.sh"
    local python="$repository/.venv/bin/python" package
    for package in . envs policies; do
        "$python" -m build --no-isolation --wheel --outdir "$1" "$repository/$package"
    done
    "$python" -m pip download --requirement "$repository/requirements.lock" --dest "$1"
    cp "$repository/.python-version" "$repository/requirements.lock" "$0" "$1"
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

# The planned command that begins with these words, as a list in `command`.
plan() {
    eval "command=($(lerobot-bimanual policy benchmark "${flags[@]}" --dry_run=true 2>/dev/null | grep -m 1 "^$1"))"
}

# The value of one of its flags.
value_of() {
    printf '%s\n' "${command[@]}" | sed -n "s/^--$1=//p"
}

run() {
    local wheels="$1" minutes="$2" record steps trial log
    shift 2
    [[ $wheels == - ]] || install "$wheels"
    flags=(--output=outputs/gpu --device="${DEVICE:-cuda}" "$@")
    lerobot-bimanual doctor
    plan "lerobot-bimanual dataset generate"
    [[ -d "$(value_of root)" ]] || "${command[@]}"
    plan "lerobot-[a-z-]*train"
    record="$(value_of output_dir).steps-in-$minutes-minutes"
    if ! [[ -f $record ]]; then
        trial="$(mktemp -d)"
        log="$("${command[@]}" --steps=60 --log_freq=20 --save_checkpoint=false --output_dir="$trial/train" 2>&1)" ||
            { echo "$log" >&2; exit 1; }
        mkdir -p "$(dirname "$record")"
        # Only the last 20 steps count: before them, loaders start and layers are compiled.
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
run:[0-2] | [!r]* | :*) sed -n '2,/^set /{/^# \{0,1\}/s///p}' "$0" >&2 && exit 2 ;;
run:*) run "${@:2}" ;;
esac
