#!/usr/bin/env bash
# Draws the head with 3D-texture slices on the default Vulkan device, compares the picture with the
# float64 reference, and says on which device, how fast and how exact:
#
#     tools/demo.sh             (after `cargo build --release`; `make demo` does both)
#     PROFILE=dev tools/demo.sh (after `cargo build`)
#
# The device is the loader's and the program's choice: a GPU where there is one, else lavapipe.
# VK_DRIVER_FILES and the like work as always.
set -euo pipefail
export LC_ALL=C # a decimal point, whatever the language
cd "$(dirname "$0")/.."

folder=${PROFILE:-release}
[ "$folder" != dev ] || folder=debug
program=${CARGO_TARGET_DIR:-target}/$folder/volraster
scene=assets/head.json
technique=slices-3d # what the scene names; `compare` is told it, to compare nothing else
out=out

[ -x "$program" ] || {
    echo "demo: $program is not there; run: make demo" >&2
    exit 1
}
mkdir -p "$out"
# What an earlier run left must not be taken for this one's.
rm -f "$out/head.png" "$out/head.exr" "$out/head.stats.json" "$out/errors.json"

"$program" render "$scene" -o "$out/head.exr" --frames 1 --stats "$out/head.stats.json"
"$program" render "$scene" -o "$out/head.png"
"$program" compare "$scene" -o "$out" --techniques "$technique"

# value FILE KEY...: the first value behind KEY behind ... KEY. No JSON parser, but enough for files
# that the program itself has just written, and jq need not be installed.
value() {
    tr '\n' ' ' <"$1" | awk -v keys="${*:2}" '{
        n = split(keys, key, " ")
        for (k = 1; k <= n; k++) {
            at = index($0, "\"" key[k] "\"")
            if (!at) { exit 1 }
            $0 = substr($0, at + length(key[k]) + 2)
        }
        sub(/^[ \t]*:[ \t]*/, "")
        if (sub(/^"/, "")) sub(/".*/, ""); else sub(/[ \t,}\]].*/, "")
        print
    }' || {
        echo "demo: $1 has no ${*:2}" >&2
        return 1
    }
}

device=$(value "$out/head.stats.json" device name)
time_ms=$(value "$out/head.stats.json" frames wall_ms)
rmse=$(value "$out/errors.json" rmse)
largest=$(value "$out/errors.json" max)
[ -s "$out/head.png" ]

echo
echo "technique  $technique"
echo "device     $device"
printf 'time       %.1f ms a frame\n' "$time_ms"
printf 'error      RMSE %.2e, largest %.2e (premultiplied linear RGBA, against the float64 reference)\n' "$rmse" "$largest"
echo "picture    $PWD/$out/head.png"
