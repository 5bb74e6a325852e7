#!/usr/bin/env bash
# Builds the Python package as a wheel, installs it into a fresh virtual environment, and runs its tests and examples there:
#
#     tools/python.sh                 with little optimisation, as the tests are built
#     tools/python.sh --wheel DIR     only the optimised wheel, into a folder
#
# VOLRASTER_PROGRAM names the program whose images shall be the same; without it one is built.
# The examples read files of ../shared/data; without that folder they are left out.
set -euo pipefail
cd "$(dirname "$0")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
python3 -m venv "$scratch/venv"
python=$scratch/venv/bin/python
if [ "${1:-}" = --wheel ]; then
    "$python" -m pip wheel --no-deps -w "${2:?a folder}" ./python
    exit
fi
# pip builds it as a user would, but for the profile.
MATURIN_PEP517_ARGS='--profile dev' "$python" -m pip install -q ./python pytest
# Its images shall be the same.
if [ -z "${VOLRASTER_PROGRAM:-}" ]; then
    cargo build -q
    export VOLRASTER_PROGRAM=${CARGO_TARGET_DIR:-$PWD/target}/debug/volraster
fi
"$python" -m pytest -q -p no:cacheprovider python/tests
data=$PWD/../shared/data
if [ ! -d "$data" ]; then echo "no examples: there is no $data" && exit 0; fi
cd "$scratch"
for example in "$OLDPWD"/python/examples/*.py; do
    "$python" "$example" "$data" "$scratch/$(basename "$example" .py).png"
done
