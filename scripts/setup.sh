#!/usr/bin/env bash
# Make .venv ready: Python of .python-version, the packages of requirements.lock, our four packages editable.
# Does nothing when that is how things stand; safe to interrupt and to repeat.
set -euo pipefail
cd -P "$(dirname "$0")/.."

stamp=.venv/.ready
inputs=(.python-version requirements.lock pyproject.toml {envs,policies,robots}/pyproject.toml scripts/setup.sh)
# The folder is part of the state: a virtual environment holds its own absolute path and cannot be moved.
state="$PWD $(cat "${inputs[@]}" | sha256sum)"
if [[ -f $stamp && "$(<"$stamp")" == "$state" ]]; then
    exit
fi

uv="$(scripts/find_uv.sh)"
version="$(<.python-version)"
is_version="import sys; sys.exit(sys.argv[1] != '%d.%d' % sys.version_info[:2])"
if ! .venv/bin/python -c "$is_version" "$version" 2>/dev/null || ! grep -qF "$PWD/.venv" .venv/bin/activate; then
    rm -rf .venv
    "$uv" venv --quiet --seed --python "$version" .venv
fi
rm -f "$stamp"
export VIRTUAL_ENV="$PWD/.venv"
"$uv" pip install --quiet --requirements requirements.lock
# The lock holds the build backend and every dependency, so nothing is resolved or fetched here.
"$uv" pip install --quiet --no-deps --no-build-isolation \
    --editable . --editable envs --editable policies --editable robots
echo "$state" >"$stamp"
echo "Ready: $PWD/.venv"
echo "Next: source .venv/bin/activate && lerobot-bimanual doctor"
