#!/usr/bin/env bash
# Makes captures with gfxreconstruct, one for each technique and route, and replays them (docs/VALIDATION.md, "Captures"):
#
#     tools/captures.sh [OUT] [-- WORD...]    into out/captures; with words only the captures whose names contain one
#
# The device that VK_DRIVER_FILES or VOLRASTER_DEVICE select draws three frames of a small scene and presents them in a window of
# a display without a screen (Xvfb). A capture has at most 5 MB. Each is replayed twenty times (CAPTURES_REPLAYS) on that driver and
# on the one of tools/lavapipe25.sh, where that is. The last frame must be the program's picture on the first driver, always the
# same on each, and not the first frame. OUT gets the captures and `traces.toml`, which gpu-trace-perf reads.
# It installs what it needs.
set -euo pipefail
cd "$(dirname "$0")/.."

out=out/captures
if [ $# -gt 0 ] && [ "$1" != -- ]; then out=$1 && shift; fi
if [ $# -gt 0 ]; then shift; fi
words=("$@")
replays=${CAPTURES_REPLAYS:-20}
frames=3
most=5000000

tools/setup.sh --tests --window
for tool in gfxrecon-replay gfxrecon-info Xvfb; do
    command -v $tool >/dev/null || { echo "captures: $tool is not installed" >&2 && exit 1; }
done
tools/lavapipe25.sh >/dev/null
cargo build --features window
program=${CARGO_TARGET_DIR:-target}/debug/volraster

mkdir -p "$out"
out=$(cd "$out" && pwd)
scratch=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server"; rm -rf "$scratch"' EXIT
mkfifo "$scratch/display"
Xvfb -displayfd 3 -screen 0 640x480x24 -nolisten tcp -noreset 3<>"$scratch/display" 2>"$scratch/xvfb" &
server=$!
read -r number <"$scratch/display"
export DISPLAY=:$number
unset WAYLAND_DISPLAY WAYLAND_SOCKET
export XDG_RUNTIME_DIR=$scratch # Mesa looks for one

# The name of the device that an environment selects, as traces.toml has it.
device() {
    "$@" "$program" devices --json | python3 -c '
import json, re, sys
chosen = next(device for device in json.load(sys.stdin)["devices"] if device["chosen"])
print(re.sub("[^a-z0-9.]+", "-", chosen["driver"].split(" (")[0].lower()))'
}
first=(env)
second=(env VK_DRIVER_FILES="$PWD/.deps/lavapipe25/lvp_icd.json"
    LD_LIBRARY_PATH="$(echo "$PWD"/.deps/lavapipe25/root/usr/lib/*-linux-gnu)${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}")
drivers=(first)
if [ -f .deps/lavapipe25/lvp_icd.json ]; then drivers+=(second); fi
declare -A names
for driver in "${drivers[@]}"; do
    declare -n environment=$driver
    names[$driver]=$(device "${environment[@]}")
done
[ "${names[first]}" != "${names[second]:-}" ] || drivers=(first)

camera='"camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42}, "image": {"width": 128, "height": 128}'
cat >"$scratch/grid.json" <<END
{"volume": {"field": "marschner-lobb", "dims": [32, 32, 32], "type": "f32"}, "transfer": {"preset": "shells", "range": [0, 1]}, $camera}
END
cat >"$scratch/mesh.json" <<END
{"mesh": {"field": "blobs", "cubes": 8}, "transfer": {"preset": "fog", "range": [0, 1]}, $camera}
END
cat >"$scratch/kernels.json" <<END
{"volume": {"field": "blobs", "dims": [16, 16, 16]}, "transfer": {"preset": "fog", "range": [0, 1]}, "kernels": {"kernel": "gaussian"}, $camera}
END
cat >"$scratch/gaussians.json" <<END
{"gaussians": {"file": "splats.ply"}, $camera}
END
awk 'BEGIN {
    print "ply\nformat ascii 1.0\nelement vertex 300"
    n = split("x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3", names, " ")
    for (i = 1; i <= n; i++) print "property float " names[i]
    print "end_header"
    for (i = 0; i < 300; i++) {
        t = i * 2.399963
        h = (i + 0.5) / 150 - 1
        r = sqrt(1 - h * h)
        printf "%.6f %.6f %.6f %.6f %.6f %.6f 2 -2 -3 -4 1 %.6f %.6f 0\n",
            r * cos(t), h, r * sin(t), sin(i), sin(1.3 * i), cos(i), sin(t), cos(t)
    }
}' >"$scratch/splats.ply"

# sum FRAME.bmp: SHA-256 of its pixels, row by row from the top, a byte each for red, green and blue, as gpu-trace-perf has it.
# same FRAME.bmp PICTURE.png: whether no byte differs by more than 1. The device rounds sRGB, and the host does.
cat >"$scratch/images.py" <<'END'
import hashlib, struct, sys, zlib

def bmp(path):
    data = open(path, "rb").read()
    start, = struct.unpack_from("<I", data, 10)
    width, height, _, bits = struct.unpack_from("<iiHH", data, 18)
    size, pitch = bits // 8, (width * bits + 31) // 32 * 4
    rows = [data[start + y * pitch:][:width * size] for y in range(abs(height))]
    flat = b"".join(rows[::-1] if height > 0 else rows)
    rgb = bytearray(3 * width * abs(height))
    for channel in range(3):
        rgb[channel::3] = flat[2 - channel::size]
    return width, abs(height), bytes(rgb)

def png(path):
    data, at, packed = open(path, "rb").read(), 8, b""
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack_from(">IIBB", data, at + 8)
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += size + 12
    assert (depth, colour) == (8, 2), "8-bit RGB is expected"
    data, row, out = zlib.decompress(packed), bytearray(3 * width), bytearray()
    for y in range(height):
        line = bytearray(data[y * (3 * width + 1):][:3 * width + 1])
        method, line = line[0], line[1:]
        for x in range(3 * width):
            a, b, c = (line[x - 3], row[x], row[x - 3]) if x >= 3 else (0, row[x], 0)
            p = a + b - c
            paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[x] = line[x] + (0, a, b, (a + b) // 2, paeth)[method] & 255
        row = line
        out += row
    return width, height, bytes(out)

if sys.argv[1] == "sum":
    print(hashlib.sha256(bmp(sys.argv[2])[2]).hexdigest())
else:
    (*size, shown), (*wanted, picture) = bmp(sys.argv[2]), png(sys.argv[3])
    sys.exit(size != wanted or any(abs(a - b) > 1 for a, b in zip(shown, picture)))
END

# replay CAPTURE VARIABLE...: replays it; prints the sums of its first and its last frame, or says why not.
replay() {
    local capture=$1
    shift
    rm -f "$scratch"/frame_*
    "$@" gfxrecon-replay -m remap --screenshots "1,$frames" --screenshot-dir "$scratch" --screenshot-prefix frame \
        --log-level error "$capture" >"$scratch/log" 2>&1 && [ -f "$scratch/frame_frame_$frames.bmp" ] || {
        echo "no replay: $(grep -m 1 -E 'FATAL|ERROR' "$scratch/log" || tail -n 1 "$scratch/log")"
        return 1
    }
    echo "$(python3 "$scratch/images.py" sum "$scratch/frame_frame_1.bmp")" \
        "$(python3 "$scratch/images.py" sum "$scratch/frame_frame_$frames.bmp")"
}

made=0 failed=0
fail() { failed=$((failed + 1)) && printf '%-34s FAILED: %s\n' "$name" "$*"; }

# capture NAME SCENE TECHNIQUE: makes a capture and replays it.
capture() {
    local name=$1 scene=$scratch/$2.json technique=$3 file=$out/$1.gfxr status=0 bytes driver sums once line entry=
    if [ ${#words[@]} -gt 0 ] && ! grep -qF "$(printf '%s\n' "${words[@]}")" <<<"$name"; then return 0; fi
    local draw=("$program" -q render "$scene" --technique "$technique" --frames $frames --orbit 20 --emulate no-buffer-addresses)
    "${draw[@]}" -o "$scratch/plain-%d.png" 2>"$scratch/log" || status=$?
    if [ $status = 3 ]; then
        printf '%-34s not on %s: %s\n' "$name" "${names[first]}" "$(tail -n 1 "$scratch/log")"
        return 0
    fi
    rm -f "$file"
    # Without the alignment the layer's copies of mapped memory overwrite what the driver writes beside a buffer.
    VK_INSTANCE_LAYERS=VK_LAYER_LUNARG_gfxreconstruct GFXRECON_CAPTURE_FILE=$file GFXRECON_CAPTURE_FILE_TIMESTAMP=false \
        GFXRECON_CAPTURE_COMPRESSION_TYPE=ZSTD GFXRECON_PAGE_GUARD_ALIGN_BUFFER_SIZES=true GFXRECON_LOG_LEVEL=error \
        "${draw[@]}" --present window -o "$scratch/drawn-%d.png" >"$scratch/log" 2>&1 && [ -f "$file" ] || {
        fail "no capture: $(tail -n 1 "$scratch/log")"
        return 0
    }
    bytes=$(stat -c %s "$file")
    if [ "$bytes" -gt $most ]; then fail "$bytes bytes, more than $most" && return 0; fi
    line=$(printf '%-34s %7d bytes' "$name" "$bytes")
    for driver in "${drivers[@]}"; do
        local -n variables=$driver
        sums=
        for ((i = 0; i < replays; i++)); do
            once=$(replay "$file" "${variables[@]}") || { fail "${names[$driver]}: $once" && return 0; }
            if [ "${sums:=$once}" != "$once" ]; then fail "${names[$driver]}: replay $i shows another picture" && return 0; fi
        done
        if [ "${sums% *}" = "${sums#* }" ]; then fail "the first and the last frame are equal" && return 0; fi
        if [ "$driver" = first ] && ! python3 "$scratch/images.py" same "$scratch/frame_frame_$frames.bmp" "$scratch/plain-$((frames - 1)).png"; then
            fail "the replay does not show the program's picture" && return 0
        fi
        line+="  ${sums: -64:12}"
        entry+=$(printf '\n[traces.devices."%s"]\nchecksum = "%s"' "${names[$driver]}" "${sums#* }")
    done
    echo "$line"
    made=$((made + 1))
    printf '\n[[traces]]\npath = "%s.gfxr"\n%s\n' "$name" "$entry" >>"$out/traces.toml"
}

printf '[traces_db]\ndownload_url = ""\n' >"$out/traces.toml"
printf 'check sums of the last frame after %d equal replays:' "$replays"
for driver in "${drivers[@]}"; do printf ' %s' "${names[$driver]}"; done
printf '\n'
mapfile -t rows < <("$program" techniques --json | python3 -c '
import json, sys
scenes = {"grid": "grid", "mesh": "mesh", "points": "kernels", "gaussians": "gaussians"}
for technique in json.load(sys.stdin):
    name, scene, routes = technique["name"], scenes[technique["data"][0]], technique["routes"]
    for route in routes:
        one = len(routes) == 1
        print(name if one else f"{name}-{route}", scene, name if one else f"{name}:route={route}")')
for row in "${rows[@]}"; do
    # shellcheck disable=SC2086 # three words
    capture $row
done
printf '%d captures in %s, %d failed\n' "$made" "$out" "$failed"
[ "$failed" = 0 ] && [ "$made" != 0 ]
