#!/usr/bin/env bash
# Compiles the shaders of every technique for AMD GPUs without such a GPU, and lists their statistics:
#
#     tools/shader-stats.sh          writes docs/SHADERS.md
#     tools/shader-stats.sh --check  compares with it: fails on a new spill, and where occupancy falls by more than a step
#
# RADV of the second driver (tools/lavapipe25.sh) compiles for the chip that RADV_FORCE_FAMILY names. It cannot draw, so lavapipe
# prepares the frames, with the passes of a GPU. Where that driver or the program is missing, nothing is done.
set -euo pipefail
cd "$(dirname "$0")/.."

table=docs/SHADERS.md
program=${CARGO_TARGET_DIR:-target}/debug/volraster
[ -x "$program" ] || program=${CARGO_TARGET_DIR:-target}/release/volraster
folder=$PWD/.deps/lavapipe25
libraries=$(dirname "$(sed -nE 's/.*"library_path": "([^"]*)".*/\1/p' "$folder/lvp_icd.json" 2>/dev/null)")
if [ ! -x "$program" ] || [ ! -f "$libraries/libvulkan_radeon.so" ]; then
    echo "shader-stats: no program or no second driver here (make build, tools/lavapipe25.sh): nothing to do"
    exit 0
fi

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cat >"$scratch/radeon.json" <<END
{"ICD": {"api_version": "1.4.305", "library_path": "$libraries/libvulkan_radeon.so"}, "file_format_version": "1.0.0"}
END

version=$(sed -E 's/[^0-9]*([0-9]+\.[0-9]+\.[0-9]+).*/\1/' "$folder/version")
{
    cat <<END
# Shaders

These are the statistics that the compiler of Mesa $version for AMD GPUs (RADV) gives of the shaders of every technique with its
default options, as \`tools/shader-stats.sh\` writes them: for a part with subgroups of 32 or 64 invocations, its predecessor, and
one with 64 only.
Several lines of a name are variants of a pass. Latency and inverse throughput are estimates in cycles. Occupancy is the number of
subgroups that a SIMD holds, at most 16, 16 and 10; those of 64 invocations count twice where a part also has 32.
END
    for family in NAVI31 NAVI21 VEGA20; do
        printf '\n## %s\n\n' "$family"
        env RADV_FORCE_FAMILY="$family" NODEVICE_SELECT=1 LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" \
            VK_DRIVER_FILES="$scratch/radeon.json:$folder/lvp_icd.json" "$program" pipelines --defaults --emulate as-hardware --device llvmpipe \
            --compile-on "$family" --columns \
            'VGPRs,SGPRs,Spilled VGPRs,Spilled SGPRs,LDS size,Scratch size,Subgroups per SIMD,Instructions,Latency,Inverse Throughput' \
            2>"$scratch/messages" | sed 's/subgroups per simd/occupancy/' || { cat "$scratch/messages" >&2 && exit 1; }
    done
} >"$scratch/table"

if [ "${1:-}" != --check ]; then
    cp "$scratch/table" "$table"
    exit 0
fi
if ! grep -q "Mesa $version for" "$table"; then
    echo "shader-stats: $table is of another version of Mesa than $version: nothing to compare"
    exit 0
fi
# Variants of a name come in one order, so each line has its number.
awk -F ' *\\| *' '
    /^## / { part = $0 }
    NF < 12 || $2 == "pipeline" || $2 == "---" { next }
    { key = part " " $2 " " $3; key = key " " ++seen[FILENAME, key] }
    FNR == NR { spills[key] = $7 + $8 + $10; occupancy[key] = $11; next }
    { at_all++ }
    !(key in spills) { if ($7 + $8 + $10 > 0) { print key ": spills " $7 " + " $8 ", scratch " $10; bad = 1 } next }
    $7 + $8 + $10 > spills[key] { print key ": spills more: " spills[key] " -> " $7 + $8 + $10; bad = 1 }
    $11 < occupancy[key] - 2 { print key ": occupancy falls: " occupancy[key] " -> " $11; bad = 1 }
    END { if (!at_all) { print "no shader was compiled"; bad = 1 } exit bad }
' "$table" "$scratch/table"
