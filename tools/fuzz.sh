#!/usr/bin/env bash
# Fuzzes the readers of data files, one after the other, for some seconds each:
#
#     tools/fuzz.sh [-s SECONDS] [TARGET...]
#
# Needs a nightly toolchain and `cargo install cargo-fuzz`. Begins with the small samples of the tests. What is
# found lies under fuzz/artifacts: it belongs under tests/findings then, where ordinary tests replay it.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=60
if [ "${1:-}" = -s ]; then
    seconds=$2
    shift 2
fi
VOLRASTER_CORPUS=$PWD/fuzz/corpus cargo test --quiet --test host measure_corpus -- --ignored
mapfile -t targets < <(cargo +nightly fuzz list)
if [ $# != 0 ]; then targets=("$@"); fi
for target in "${targets[@]}"; do
    echo "==> $target"
    cargo +nightly fuzz run "$target" "fuzz/corpus/$target" -- \
        -max_total_time="$seconds" -rss_limit_mb=1024 -malloc_limit_mb=256 -timeout=10 -max_len=16384 -print_final_stats=1
done
