#!/usr/bin/env bash
# Draws the gallery of splats in docs/TECHNIQUES.md from real data, which is not part of the repository:
#
#     tools/gallery.sh DATA [PROGRAM]      (after `cargo build --release`)
#
# DATA holds the folders `particles`, `structured` and `unstructured` with the files named below.
set -euo pipefail
data=$(realpath -- "${1:?usage: tools/gallery.sh DATA [PROGRAM]}")
program=${2:+$(realpath -m -- "$2")}
cd "$(dirname "$0")/.."
program=${program:-${CARGO_TARGET_DIR:-target}/release/volraster}

draw() { # NAME FILE TECHNIQUE
    "$program" render "$data/$2" -o "docs/images/splats-$1.png" --size 256x256 --technique "$3"
}
draw bunny particles/bunny_fluid_7706.vtk splat-ewa:order=slabs
draw knot particles/sailors_knot_19539.vtk splat-ewa:order=slabs
draw halo particles/dark_matter_halo.npy splat-ewa
draw brain structured/MR_Gd.nii.gz splat-sheets:kernel=bspline
draw engine structured/engine.nii.gz splat-ewa:order=slabs
draw bluntfin unstructured/bluntfin_tets.vtu splat-ewa
