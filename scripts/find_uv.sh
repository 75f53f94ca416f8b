#!/usr/bin/env bash
# Print the path of a working uv. Where there is none, install it into the private folder .uv first.
set -euo pipefail
cd "$(dirname "$0")/.."

# `--version` must succeed: a version manager's shim can exist on PATH without a uv behind it.
for uv in uv "$HOME/.local/bin/uv" .uv/bin/uv; do
    if "$uv" --version >/dev/null 2>&1; then
        command -v "$uv"
        exit
    fi
done

if ! command -v python3 >/dev/null; then
    echo "No python3 found. Install it with: sudo apt-get install -y python3 python3-venv" >&2
    exit 1
fi
echo "No working uv found; installing it into .uv" >&2
rm -rf .uv
if ! python3 -m venv .uv >&2; then
    rm -rf .uv
    echo "python3 cannot make virtual environments. Install: sudo apt-get install -y python3-venv" >&2
    exit 1
fi
.uv/bin/python -m pip install --quiet --disable-pip-version-check uv >&2
echo .uv/bin/uv
