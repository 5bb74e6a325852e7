#!/usr/bin/env bash
# Builds the tests and runs them under the validation layers:
#
#     tools/test.sh                    the gate's tests, on the default device
#     tools/test.sh --all              every case of every test; on a second driver, those of the gate; the self-test at every width of
#                                      subgroups, and draws on a third driver
#     tools/test.sh --devices          only the tests that depend on a driver
#     tools/test.sh [...] -- WORD...   only the tests whose names contain a word
#
# A test marked `ignore` runs with --all, except those named `child_...` (run by another test, in a process of its own) and
# `measure_...` (prints figures, or is a tool). Loops inside of tests take a selection of their cases without --all
# (`taken` in tests/common/mod.rs). At the end come the ten slowest tests and a line "N passed, N failed".
set -euo pipefail
cd "$(dirname "$0")/.."

all=false devices=false
filter=()
while [ $# -gt 0 ]; do
    case $1 in
    --all) all=true ;;
    --devices) devices=true ;;
    --) shift && filter=("$@") && break ;;
    *) echo "tools/test.sh: unknown argument '$1' (--all, --devices, -- WORD...)" >&2 && exit 2 ;;
    esac
    shift
done

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
passed=0 failed=0
: >"$scratch/times"

# count NAME LOG STATUS: adds up the tests of a log, and one failure more where it failed without a failed test.
count() {
    local ok bad
    read -r ok bad < <(awk '
        /^test result: / {
            for (i = 1; i < NF; i++) {
                if ($(i + 1) == "passed;") ok += $i
                if ($(i + 1) == "failed;") bad += $i
            }
        }
        END { print ok + 0, bad + 0 }' "$2")
    if [ "$3" != 0 ] && [ "$bad" = 0 ]; then
        echo "$1 failed with status $3"
        bad=1
    fi
    passed=$((passed + ok)) failed=$((failed + bad))
}

# run DRIVER NAME EXECUTABLE ARGUMENT...: runs tests of an executable. A driver without a GPU has no watchdog: an endless shader
# would hang for ever. Tests of devices have a process for each module, in which they run one at a time, and as many processes at once as
# there are processors: the layer keeps its table of devices without a lock, so that within a process a test with a device of its own waits
# until no other test has one. The families of `extremes` are run once, since those and their document have one process.
run() {
    local status=0 driver=$1 name=$2 executable=$3 arguments=(-Zunstable-options --report-time)
    shift 3
    if $every; then arguments+=(--include-ignored --skip child_ --skip measure_); fi
    printf '\n==> %s, %s\n' "$name" "$driver"
    # --report-time is unstable; a process of the tests alone is told to accept it.
    local tests=(env RUSTC_BOOTSTRAP=1 timeout --kill-after=10 5400 "$executable" "${arguments[@]}")
    if [ "$name" = device ]; then
        # A line for each module, the longest first. Lines of the tests are passed on when they are whole.
        "${tests[@]}" --list --format terse "$@" | sed -nE 's/: test$//p' |
            awk -F:: '{ names[$1] = names[$1] " " $0 } END { for (module in names) print length(names[module]) names[module] }' |
            sort -rn | cut -d ' ' -f 2- |
            xargs -r -L 1 -P "$(printf '%s\n' 4 "$(nproc)" | sort -n | head -1)" \
                bash -c 'set -o pipefail; "$@" 2>&1 | grep --line-buffered ""' '' env RUST_TEST_THREADS=1 "${tests[@]}" --exact |
            tee "$scratch/log" || status=$?
    else
        "${tests[@]}" "$@" 2>&1 | tee "$scratch/log" || status=$?
    fi
    count "$name" "$scratch/log" "$status"
    sed -nE "s/^test (.*) \.\.\. (ok|FAILED).* <([0-9.]+)s>$/\3 $name::\1/p" "$scratch/log" >>"$scratch/times"
}

# selftest NAME VARIABLE... -- ARGUMENT...: runs the self-test, which counts as a test.
selftest() {
    local name=$1 variables=()
    shift
    while [ "$1" != -- ]; do variables+=("$1") && shift; done
    shift
    printf '\n==> %s\n' "$name"
    if env "${variables[@]}" "${CARGO_TARGET_DIR:-target}/debug/volraster" selftest "$@"; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
    fi
}

begin=$SECONDS
cargo test --no-run --features mpi 2>&1 | tee "$scratch/build"
mapfile -t executables < <(sed -nE 's/^ *Executable .*\((.*)\)$/\1/p' "$scratch/build")
[ ${#executables[@]} -gt 0 ] || { echo "no test executable was built" && exit 1; }
printf '\n==> built in %d s\n' $((SECONDS - begin))

# Those that depend on a driver. Nor do the rooms below `gpu` and the orders of cells. Failing calls and the doors of engines open devices too,
# but do with them what the others do: the second driver has them with --all. Cases differ in what they ask of the program, not of the driver.
on_devices='^(volraster|device)$'
if $all; then on_devices='^(volraster|device|failures|embed|c_interface)$'; fi
on_host='^(num|image|replace|scene|optics|io|reference|technique::mesh::order)::'
drivers=("the default device")
widths=(128 256 512)
every=$all
if $every; then export VOLRASTER_TESTS=all; fi
# Compiling pipelines takes most of the time of small images. Mesa's software driver compiles without optimisation, except on the default
# device with --all.
without_optimisation=${GALLIVM_PERF-nopt}
if ! $every; then export GALLIVM_PERF=$without_optimisation; fi
second=.deps/lavapipe25/lvp_icd.json
if $all && [ -f "$second" ]; then drivers+=("the second driver"); fi
for driver in "${drivers[@]}"; do
    if [ "$driver" = "the second driver" ]; then
        export VK_DRIVER_FILES=$PWD/$second
        LD_LIBRARY_PATH=$(echo "$PWD"/.deps/lavapipe25/root/usr/lib/*-linux-gnu)${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
        export LD_LIBRARY_PATH
        devices=true every=false widths=(128)
        unset VOLRASTER_TESTS
        export GALLIVM_PERF=$without_optimisation
    fi
    for executable in "${executables[@]}"; do
        name=$(basename "$executable")
        name=${name%-*}
        if $devices && ! [[ $name =~ $on_devices ]]; then continue; fi
        if [ "$name" = volraster ] && $devices && ! $every && [ ${#filter[@]} = 0 ]; then
            mapfile -t names < <("$executable" --list --format terse | sed -nE 's/: test$//p' | grep -vE "$on_host")
            run "$driver" "$name" "$executable" --exact "${names[@]}"
        else
            run "$driver" "$name" "$executable" "${filter[@]}"
        fi
    done
    if $all && [ ${#filter[@]} = 0 ]; then
        for width in "${widths[@]}"; do
            # The key of Mesa's shader cache lacks the width.
            setting=(MESA_SHADER_CACHE_DIR="$scratch/mesa-$width" LP_NATIVE_VECTOR_WIDTH="$width")
            some=()
            # lavapipe crashes in LLVM 15 when it rasterises with vectors of 512 bits, and compiles instrumented shaders for a quarter of
            # an hour.
            if [ "$width" = 512 ]; then
                some=(--without-validation --filter draw/slices-3d:route=compute --filter draw/raycast --filter draw/havs --filter draw/splat)
            fi
            # The tests have drawn with 256.
            [ "$width" = 256 ] || selftest "self-test, vectors of $width bits, $driver" "${setting[@]}" -- "${some[@]}"
            selftest "self-test as on hardware, vectors of $width bits, $driver" "${setting[@]}" -- --emulate as-hardware "${some[@]}"
        done
        selftest "self-test with coarse weights, permuted, $driver" -- --emulate coarse-weights,permute
    fi
done
if $all && [ ${#filter[@]} = 0 ]; then
    # What differs on GPUs, on the last driver.
    device=$(printf '%s\n' "${executables[@]}" | grep /device-)
    every=false
    unset VOLRASTER_TESTS
    export VOLRASTER_EMULATE=coarse-weights
    run "$driver, $VOLRASTER_EMULATE" device "$device" grids:: layers:: prefilter:: shear_warp:: slices_3d:: tolerance::
    export VOLRASTER_EMULATE=permute,as-hardware
    run "$driver, $VOLRASTER_EMULATE" device "$device" --skip validation:: --skip threads::
    unset VOLRASTER_EMULATE
    tools/swiftshader.sh
    third=$PWD/.deps/swiftshader/vk_swiftshader_icd.json
    if [ -f "$third" ]; then
        selftest 'draws, SwiftShader' -u LD_LIBRARY_PATH VK_DRIVER_FILES="$third" -- --filter draw/
    fi
fi
if ! $devices || $all; then
    status=0
    printf '\n==> examples in the documentation\n'
    # The library is that of the other tests.
    cargo test --doc --features mpi -- "${filter[@]}" 2>&1 | tee "$scratch/log" || status=$?
    count documentation "$scratch/log" "$status"
fi

printf '\nThe ten slowest tests, seconds:\n'
sort -rn "$scratch/times" | awk 'NR <= 10'
printf '\n%d s in all\n%d passed, %d failed\n' $((SECONDS - begin)) "$passed" "$failed"
[ "$failed" = 0 ] && [ "$passed" != 0 ]
