#!/usr/bin/env bash
# A private copy of SwiftShader, a third software driver, under .deps/swiftshader:
#
#     tools/swiftshader.sh
#
# It has subgroups of 4 and another compiler than lavapipe. Debian has it in the package `chromium-common`, whose version changes
# often: the one that the machine's Debian mirror offers is taken and printed. It is unpacked beside the system and chosen by an
# environment variable. Needs no root.
#
# Without that package (another system, no network) the script says so, makes nothing and ends with 0. Callers look whether
# .deps/swiftshader/vk_swiftshader_icd.json is there.
set -euo pipefail
cd "$(dirname "$0")/.."

dir=$PWD/.deps/swiftshader
icd=$dir/vk_swiftshader_icd.json
say() { printf 'swiftshader: %s\n' "$*"; }

if [ -f "$icd" ] && grep -qF "\"$dir/" "$icd"; then
    say "there already: $(cat "$dir/version")"
    exit 0
fi
rm -rf "$dir"
new=$(mktemp -d)
trap 'rm -rf "$new"' EXIT
options=()
# As root, apt downloads as a user who may not enter the folder.
if [ "$(id -u)" = 0 ]; then options+=(-o APT::Sandbox::User=root); fi
if ! (cd "$new" && apt-get "${options[@]}" -qq download chromium-common) >"$new/log" 2>&1; then
    say "no package chromium-common to be had here ($(tail -n 1 "$new/log")): nothing fetched"
    exit 0
fi
dpkg-deb --fsys-tarfile "$new"/chromium-common_*.deb | tar -x -C "$new" ./usr/lib/chromium/libvk_swiftshader.so
mkdir -p "$dir"
mv "$new/usr/lib/chromium/libvk_swiftshader.so" "$dir"
dpkg-deb -f "$new"/chromium-common_*.deb Version >"$dir/version"
# The file's presence says that the copy is whole.
cat >"$icd" <<JSON
{
    "file_format_version": "1.0.0",
    "ICD": {"api_version": "1.3.0", "library_path": "$dir/libvk_swiftshader.so"}
}
JSON
say "of chromium $(cat "$dir/version")"
say "to use it: export VK_DRIVER_FILES=$icd"
