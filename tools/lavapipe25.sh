#!/usr/bin/env bash
# A private copy of Mesa 25's lavapipe for Debian 12, under .deps/lavapipe25:
#
#     tools/lavapipe25.sh
#
# Debian 12 has Mesa 22.3. The two lavapipes differ in ways that matter (loop limits, compiler
# faults, formats), so the tests run on both. Debian's backports have the newer one; it is unpacked
# beside the system, which stays as it is, and chosen by environment variables. Needs no root.
#
# On any other system there is no second driver to fetch: the script says so, makes nothing and
# ends with 0. Callers look whether .deps/lavapipe25/lvp_icd.json is there.
set -euo pipefail
cd "$(dirname "$0")/.."

dir=$PWD/.deps/lavapipe25
icd=$dir/lvp_icd.json

say() { printf 'lavapipe25: %s\n' "$*"; }
die() {
    printf 'lavapipe25: %s\n' "$*" >&2
    exit 1
}

usage() {
    say "to use it:"
    echo "    export VK_DRIVER_FILES=$icd"
    echo "    export LD_LIBRARY_PATH=$libraries"
}

codename=$(. /etc/os-release 2>/dev/null && echo "${ID:-}-${VERSION_CODENAME:-}" || true)
if [ "$codename" != debian-bookworm ]; then
    say "this is not Debian 12: its own Mesa is the only lavapipe here, nothing to fetch"
    exit 0
fi

libraries=$dir/root/usr/lib/$(cc -print-multiarch)

# The copy's paths are absolute: a checkout that was moved needs a new one.
if [ -f "$icd" ] && grep -qF "\"$libraries/" "$icd"; then
    say "there already: $(cat "$dir/version")"
    usage
    exit 0
fi

keyring=/usr/share/keyrings/debian-archive-keyring.gpg
[ -f "$keyring" ] || die "$keyring is missing (package debian-archive-keyring)"

# The mirror that this machine uses for Debian itself, so that a local mirror or proxy is kept.
mirror=$(apt-get indextargets --format '$(RELEASE) $(CODENAME) $(REPO_URI)' 'Created-By: Packages' |
    awk '$1 == "bookworm" || $2 == "bookworm" { print $NF; exit }')
[ -n "$mirror" ] || die "apt's configuration names no mirror for bookworm"

rm -rf "$dir"
mkdir -p "$dir/apt/lists/partial" "$dir/apt/cache/archives/partial" "$dir/root"
echo "deb [signed-by=$keyring] $mirror bookworm-backports main" >"$dir/apt/sources.list"

# apt with state, cache and sources of its own; pins of the system must not decide here.
options=(
    -o "Dir::State=$dir/apt"
    -o "Dir::State::lists=$dir/apt/lists"
    -o "Dir::Cache=$dir/apt/cache"
    -o "Dir::Etc::sourcelist=$dir/apt/sources.list"
    -o Dir::Etc::sourceparts=/dev/null
    -o Dir::Etc::preferences=/dev/null
    -o Dir::Etc::preferencesparts=/dev/null
)
# As root, apt downloads as a user who may not enter the checkout.
if [ "$(id -u)" = 0 ]; then options+=(-o APT::Sandbox::User=root); fi

apt-get "${options[@]}" -qq update || die "bookworm-backports could not be read from the machine's Debian mirror"
# libdrm2 too: lavapipe is linked with it, and Mesa 25 wants a newer one than Debian 12 has.
(cd "$dir/apt" && apt-get "${options[@]}" -qq download mesa-vulkan-drivers libdrm2) ||
    die "the packages could not be downloaded"
for package in "$dir"/apt/*.deb; do dpkg -x "$package" "$dir/root"; done
version=$(dpkg-deb -f "$dir"/apt/mesa-vulkan-drivers_*.deb Version)
rm -rf "$dir/apt"

[ -f "$libraries/libvulkan_lvp.so" ] || die "the package holds no lavapipe"

# Does the loader take it, and is it the version meant? A few declarations are enough for that, so
# the Vulkan headers need not be installed.
check=$(mktemp -d)
trap 'rm -rf "$check"' EXIT
cat >"$check/check.c" <<'C'
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>

typedef void *Handle;
typedef struct { int type; const void *next; const char *app; uint32_t v1; const char *engine; uint32_t v2, api; } AppInfo;
typedef struct { int type; const void *next; uint32_t flags; const AppInfo *app; uint32_t layers; const char *const *l; uint32_t exts; const char *const *e; } InstanceInfo;
typedef struct { int type; void *next; int id; char name[256], info[256]; uint8_t conformance[4]; } Driver;
typedef struct { int type; void *next; char properties[4096]; } Properties; /* larger than the real one */

int main(void) {
    void *loader = dlopen("libvulkan.so.1", RTLD_NOW);
    if (!loader) return fprintf(stderr, "%s\n", dlerror()), 1;
    int (*create)(const InstanceInfo *, const void *, Handle *) = dlsym(loader, "vkCreateInstance");
    int (*enumerate)(Handle, uint32_t *, Handle *) = dlsym(loader, "vkEnumeratePhysicalDevices");
    void (*properties)(Handle, Properties *) = dlsym(loader, "vkGetPhysicalDeviceProperties2");
    AppInfo app = {.type = 0, .api = 1u << 22 | 3u << 12};
    InstanceInfo info = {.type = 1, .app = &app};
    Handle instance, device;
    uint32_t count = 1;
    if (create(&info, 0, &instance) != 0 || enumerate(instance, &count, &device) < 0 || count != 1)
        return fprintf(stderr, "no device\n"), 1;
    Driver driver = {.type = 1000196000};
    Properties all = {.type = 1000059001, .next = &driver};
    properties(device, &all);
    printf("%s, %s\n", driver.name, driver.info);
    return 0;
}
C
cc "$check/check.c" -ldl -o "$check/check"

# Beside it first: the file's presence says that the copy is whole and works. (The loader takes no
# other ending than .json.)
new=$dir/new.json
cat >"$new" <<JSON
{
    "file_format_version": "1.0.0",
    "ICD": {"api_version": "1.3.0", "library_path": "$libraries/libvulkan_lvp.so"}
}
JSON
found=$(VK_DRIVER_FILES="$new" LD_LIBRARY_PATH="$libraries" "$check/check") ||
    die "the Vulkan loader does not take the unpacked driver"
case $found in
"llvmpipe, Mesa ${version%%-*}"*) ;;
*) die "expected llvmpipe of Mesa ${version%%-*}, the loader found: $found" ;;
esac
echo "$found" >"$dir/version"
mv "$new" "$icd"
say "$found"
usage
