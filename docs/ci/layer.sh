#!/usr/bin/env bash
# Tests a build of the Khronos validation layer with volraster:
#
#     VK_LAYER_PATH=BUILD/layers layer.sh OUT [FAULT...]
#
# OUT gets faults.json, which tells what the layer hears of each fault, and selftest.json: correct work, on which the layer must be
# silent. The exit status is 1 if the layer misses a fault that it heard in the file BASELINE, an earlier faults.json, or reports
# correct work. With names of faults only these are committed, and no work is drawn.
#
# Environment: VOLRASTER, the program (else the one on PATH); VK_DRIVER_FILES, the driver, such as lavapipe.
set -euo pipefail
out=${1:?OUT: the folder for results}
shift
program=$(command -v "${VOLRASTER:-volraster}") || { echo "layer.sh: ${VOLRASTER:-volraster}: no such program: set VOLRASTER" >&2; exit 2; }
# Loaders that do not know VK_EXT_layer_settings hide it from the layer.
export VK_LOADER_DISABLE_INST_EXT_FILTER=1

mkdir -p "$out"
status=0
"$program" provoke "${@:-all}" ${BASELINE:+--baseline "$BASELINE"} -o "$out/faults.json" || status=$?
if [ $# = 0 ]; then "$program" selftest -o "$out/selftest.json" || status=$?; fi
exit $status
