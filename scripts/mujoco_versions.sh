#!/usr/bin/env bash
# Play the expert of every task once with the lowest and with the newest MuJoCo that may be installed.
# MuJoCo alone is installed, into build/, and takes the place of the one in .venv for these runs.
set -euo pipefail
cd "$(dirname "$0")/.."

uv="$(scripts/find_uv.sh)"
range="$(grep -oP '(?<="mujoco)>=[^"]+' envs/pyproject.toml)"
lowest="${range#>=}"
mkdir -p build
grep -v '^mujoco' requirements.lock >build/without_mujoco.lock
for wanted in "==${lowest%%,*}.0" "$range"; do
    target="$PWD/build/mujoco"
    rm -rf "$target"
    "$uv" pip install --quiet --python .venv --target "$target" --constraint build/without_mujoco.lock "mujoco$wanted"
    echo "mujoco$wanted"
    PYTHONPATH="$target" .venv/bin/lerobot-bimanual expert evaluate --episodes=1
done
