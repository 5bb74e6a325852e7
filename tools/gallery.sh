#!/usr/bin/env bash
# Draws the gallery of splats in docs/TECHNIQUES.md and the presets of docs/PRESETS.md from real data, which is not part of
# the repository:
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

# The page of presets.
page=docs/PRESETS.md
sets="head:structured/headsq/quarter.nhdr brain:structured/MR_Gd.nii.gz hydrogen:structured/hydrogen.vti fin:unstructured/bluntfin_tets.vtu"
rows=$("$program" render --help | sed -nE 's/^ +- ([a-z-]+): +(.*)$/\1|\2/p')
mkdir -p docs/images/presets
{
    cat <<TEXT
# Presets

\`--preset NAME\`, or \`{"preset": "NAME"}\` as \`transfer\` of a scene file, shows data in a ready-made way. \`--range\`, \`--opacity\`,
\`--colormap\` and \`--scale\` change it further, in this order; \`--mode\` wins over the preset's mode. \`--range LO..HI\` alone stretches the
automatic transfer function.

- \`grey\`, \`fog\`, \`shells\`, \`bone\` and \`surface\` are stretched over the range of the scalars. Their extinction suits a box of side 2, and is
  multiplied by \`tau_scale\`, by default 2 / the longest side of the data's box.
- \`ct-...\` stand in Hounsfield units if the data have scalars below -200 and above 200; increased by 1024 if they reach from 0 or more to 1,500 to
  4,095, as 12-bit scanners store them; else air to dense bone (-1000 to 2000) are stretched over the range of the scalars.
- Extinction of \`ct-...\`, \`diverging\`, \`log\` and \`xray\` is fitted to the data: the densest tenth of the rays has a fixed optical depth.
- Presets of solid bodies are lit on grids. \`mip\` is for grids, \`log\` for data with different positive scalars.

Below: a CT of a head and a blunt fin's mesh (VTK, BSD-3), a brain (contrast MR, niivue, BSD-2) and a hydrogen orbital (pyvista, Apache-2.0),
each with its automatic camera. \`tools/gallery.sh\` draws them and this page.

| preset | shows | head | brain | hydrogen | fin |
|---|---|---|---|---|---|
TEXT
    while IFS='|' read -r name purpose; do
        row="| \`$name\` | $purpose |"
        for set in $sets; do
            image=images/presets/$name-${set%%:*}.png
            if "$program" render -q "$data/${set#*:}" -o "docs/$image" --preset "$name" --size 96x96 2>/dev/null; then
                row+=" ![$name, ${set%%:*}]($image) |"
            else
                row+=" |"
            fi
        done
        printf '%s\n' "$row"
    done <<<"$rows"
} >"$page"
