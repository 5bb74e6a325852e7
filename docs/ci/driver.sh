#!/usr/bin/env bash
# Tests a Vulkan driver with volraster:
#
#     VK_DRIVER_FILES=DRIVER.json driver.sh OUT
#
# OUT gets device.json, the results of the self-test (selftest/results.csv, failures.csv, junit.xml) and pipelines.json, with what
# the driver's compiler tells about each pipeline. The exit status is that of the self-test: 0 if all
# results are as expected. That a test of fails.txt passes is not.
#
# Environment: VOLRASTER, the program (else the one on PATH); EXPECTED, a folder that may hold fails.txt, flakes.txt and skips.txt in
# the forms of deqp-runner; JOBS, processes at a time (else one for each processor).
# It needs gtest-runner and deqp-runner, both of `cargo install deqp-runner`.
set -euo pipefail
out=${1:?OUT: the folder for results}
program=$(command -v "${VOLRASTER:-volraster}") || { echo "driver.sh: ${VOLRASTER:-volraster}: no such program: set VOLRASTER" >&2; exit 2; }
{ command -v gtest-runner && command -v deqp-runner; } >/dev/null || { echo "driver.sh: gtest-runner and deqp-runner are missing: cargo install deqp-runner" >&2; exit 2; }
jobs=${JOBS:-$(nproc)}

rm -rf "$out/selftest"
mkdir -p "$out/selftest"
"$program" devices --json >"$out/device.json"

expected=()
for list in baseline=fails flakes=flakes skips=skips; do
    file=${EXPECTED:-/nonexistent}/${list#*=}.txt
    if [ -f "$file" ]; then expected+=("--${list%=*}" "$file"); fi
done
status=0
gtest-runner run --gtest "$program" --output "$out/selftest" --jobs "$jobs" --tests-per-group 40 --timeout 300 \
    "${expected[@]}" -- selftest || status=$?
deqp-runner junit --testsuite volraster --results "$out/selftest/results.csv" --output "$out/selftest/junit.xml"
"$program" pipelines --json >"$out/pipelines.json"
exit $status
