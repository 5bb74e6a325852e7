#!/usr/bin/env bash
# Draws the pictures of docs/TECHNIQUES.md into docs/images:
#
#     tools/pictures.sh [PROGRAM]       (after `cargo build --release`; `make pictures` does both)
#
#     quantised.png   thin fog in some 400 slices, blended in 8 bits and rounded to nearest
#     dithered.png    the same, rounded at random: dither=alpha
#     blue.png        the same with thresholds of blue noise: dither=blue
#     clipped.png, opaque.png, translucent.png
#                     shells cut by a plane and a crop box, with opaque surfaces in them, with translucent ones
#     lit.png, isosurface.png, maximum.png
#                     the MR head in three modes
#
# The device is the program's choice, as always. The dithered pictures are the same on every device that
# agrees on the slices; the quantised one shows how the device rounds.
set -euo pipefail
# An argument is relative to where the caller is, the default to the repository.
program=${1:+$(realpath -m -- "$1")}
cd "$(dirname "$0")/.."
program=${program:-${CARGO_TARGET_DIR:-target}/release/volraster}

[ -x "$program" ] || {
    echo "pictures: $program is not there; run: make pictures" >&2
    exit 1
}
scene=$(mktemp --suffix=.json)
trap 'rm -f "$scene"' EXIT

# Field blobs under fog: twelve Gaussians, and a transfer function that begins at nothing.
cat >"$scene" <<'SCENE'
{
  "volume": {"field": "blobs", "dims": [64, 64, 64], "type": "f32"},
  "transfer": [
    [0.00, 0.1, 0.20, 0.7, 0],
    [0.06, 0.1, 0.20, 0.7, 0],
    [0.30, 0.2, 0.60, 0.9, 1],
    [0.60, 0.9, 0.85, 0.3, 3],
    [1.00, 1.0, 0.25, 0.1, 8]
  ],
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 36},
  "image": {"width": 256, "height": 256},
  "background": [0, 0, 0, 1]
}
SCENE

draw() { # NAME OPTIONS
    "$program" render "$scene" -o "docs/images/$1.png" --technique "slices-3d:step=0.25,target=rgba8$2"
}
mkdir -p docs/images
draw quantised ""
draw dithered ",dither=alpha"
draw blue ",dither=blue"

# Field of Marschner and Lobb: CUT is what cuts it.
cut() { # NAME CUT
    cat >"$scene" <<SCENE
{
  "volume": {"field": "marschner-lobb", "dims": [128, 128, 128], "type": "f32"},
  "transfer": [
    [0.00, 0.1, 0.2, 0.6, 0],
    [0.42, 0.9, 0.4, 0.1, 0],
    [0.50, 1.0, 0.8, 0.3, 30],
    [0.58, 0.2, 0.6, 0.9, 0],
    [0.80, 0.2, 0.6, 0.9, 0],
    [0.90, 0.3, 0.4, 1.0, 2],
    [1.00, 0.6, 0.2, 0.8, 2]
  ],
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 38},
  "image": {"width": 256, "height": 256},
  "background": [0.05, 0.05, 0.08, 1],
  $2
}
SCENE
    "$program" render "$scene" -o "docs/images/$1.png" --technique slabs:step=0.5
}
cut clipped '"clip": {
    "planes": [{"point": [0, 0, 0.3], "normal": [-0.6, 0.1, -1]}],
    "crop": {"low": [-0.9, -0.9, -0.9], "high": [0.9, 0.7, 0.9]}
  }'
cut opaque '"opaque": [
    {"sphere": {"centre": [0.45, 0.3, 0.55], "radius": 0.5}, "colour": [0.9, 0.4, 0.3]},
    {"box": {"low": [-1.1, -1.15, -1.1], "high": [1.1, -0.9, 1.1]}, "colour": [0.5, 0.6, 0.5]}
  ]'
cut translucent '"opaque": [
    {"sphere": {"centre": [0.45, 0.3, 0.85], "radius": 0.5}, "colour": [0.9, 0.4, 0.3], "opacity": 0.5},
    {"box": {"low": [-0.6, -1.2, -0.3], "high": [-0.2, 1.2, 1.3]}, "colour": [0.3, 0.5, 0.9], "opacity": 0.4}
  ]'

# The MR head.
mode() { # NAME OPTION VALUE
    "$program" render assets/head.json -o "docs/images/$1.png" --size 256x256 "$2" "$3"
}
mode lit --mode lit
mode isosurface --isosurface 40
mode maximum --mode maximum
