#!/usr/bin/env bash
# Run the tests that meet other packages, in an environment of other versions than the locked ones, in build/.
# Usage: scripts/test_versions.sh lowest|newest|lerobot-main|python-3.13; LEROBOT=file:///CLONE is another copy of its main branch.
set -euo pipefail
cd "$(dirname "$0")/.."

uv="$(scripts/find_uv.sh)"
ours=(--editable .[lerobot] --editable envs --editable policies --editable robots)
kind="${1:?lowest, newest, lerobot-main or python-3.13}"
venv="$PWD/build/venv-$kind"
rm -rf "$venv"
"$uv" venv --quiet --seed --python "$([[ $kind = python-* ]] && echo "${kind#python-}" || cat .python-version)" "$venv"
export VIRTUAL_ENV="$venv"
case "$kind" in
lowest) "$uv" pip install --quiet --resolution=lowest-direct "${ours[@]}" && "$uv" pip install --quiet --group dev ;;
newest | lerobot-main)
    "$uv" pip install --quiet "${ours[@]}" --group dev
    [[ $kind = newest ]] || "$uv" pip install --quiet --no-sources --reinstall-package lerobot \
        "lerobot[training,dataset] @ ${LEROBOT:-git+https://github.com/huggingface/lerobot}"
    ;;
python-*)
    "$uv" pip install --quiet --requirements requirements.lock
    "$uv" pip install --quiet --no-deps --no-build-isolation "${ours[@]}"
    ;;
*) echo "$kind must be one of lowest, newest, lerobot-main and python-3.13" >&2 && exit 2 ;;
esac
"$venv/bin/python" -m pip list 2>/dev/null | grep -iE '^(lerobot|mujoco|torch|numpy|datasets|gymnasium|pandas) ' || true
du -sh "$venv"
"$venv/bin/lerobot-bimanual" expert evaluate --episodes=1
export OMP_NUM_THREADS=1 HF_HUB_OFFLINE=1
pytest=("$venv/bin/pytest" -q --numprocesses=auto --maxprocesses=4 --dist=loadfile)
"${pytest[@]}" -m "not slow and not weekly and not gpu" tests/core tests/policies tests/robots tests/integration
"${pytest[@]}" -m slow tests/integration/test_{ecosystem,subtasks}.py tests/integration/test_lerobot_{eval,train,names}.py
