#!/usr/bin/env bash
# Compares the speed of two Vulkan drivers with volraster:
#
#     speed.sh OUT OLD.json NEW.json [ARGUMENT...]    arguments of `volraster bench`, else `smoke --frames 20`
#
# OUT gets the results of each driver (old, new), and ratios.json. The exit status is 4 if the new driver is slower in a case by more
# than 5 % and beyond noise, 5 if it draws another image, 0 else.
#
# Environment: VOLRASTER, the program (else the one on PATH).
set -euo pipefail
out=${1:?OUT: the folder for results} old=${2:?OLD.json: a driver} new=${3:?NEW.json: a driver}
shift 3
program=$(command -v "${VOLRASTER:-volraster}") || { echo "speed.sh: ${VOLRASTER:-volraster}: no such program: set VOLRASTER" >&2; exit 2; }
if [ $# = 0 ]; then set -- smoke --frames 20; fi

VK_DRIVER_FILES=$old "$program" bench "$@" --quiet -o "$out/old"
VK_DRIVER_FILES=$new "$program" bench "$@" --quiet -o "$out/new"
"$program" bench --compare "$out/old/bench.jsonl" "$out/new/bench.jsonl" --fail-above 5% -o "$out"
