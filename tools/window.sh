#!/usr/bin/env bash
# Tries the window on a display of its own (Xvfb), with the device that VK_DRIVER_FILES or VOLRASTER_DEVICE select:
#
#     tools/window.sh [SCENE|DATA]    assets/head.json by default
#
# It opens the window under validation and checks that the still picture is that of `render`, also after the mouse has
# dragged, and that a missing display is an error of one line. It prints the time to open and the frames a second while the mouse drags.
# It installs what it needs.
set -euo pipefail
cd "$(dirname "$0")/.."
scene=${1:-assets/head.json}

tools/setup.sh --tests --window
cargo build --release --features window
program=${CARGO_TARGET_DIR:-target}/release/volraster

scratch=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server"; rm -rf "$scratch"' EXIT

# Without a display: one line, before the file is read.
if env -u DISPLAY -u WAYLAND_DISPLAY -u WAYLAND_SOCKET "$program" view no-such-file.nrrd 2>"$scratch/error"; then
    echo "a missing display is no error" >&2
    exit 1
fi
[ "$(wc -l <"$scratch/error")" = 1 ] && grep -q 'cannot open a window' "$scratch/error" || {
    cat "$scratch/error" >&2
    exit 1
}

mkfifo "$scratch/display"
Xvfb -displayfd 3 -screen 0 1280x800x24 -nolisten tcp 3<>"$scratch/display" 2>"$scratch/xvfb" &
server=$!
read -r number <"$scratch/display"
export DISPLAY=:$number
unset WAYLAND_DISPLAY WAYLAND_SOCKET
export XDG_RUNTIME_DIR=$scratch # Mesa looks for one

"$program" -q render "$scene" -o "$scratch/render.exr"
"$program" view "$scene" --validate --save "$scratch/view.exr"
cmp "$scratch/render.exr" "$scratch/view.exr"
"$program" view "$scene" --drag 100 --save "$scratch/dragged.exr"
"$program" -q render "$scratch/dragged.json" -o "$scratch/render.exr"
cmp "$scratch/render.exr" "$scratch/dragged.exr"
