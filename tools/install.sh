#!/usr/bin/env bash
# Builds the libraries for C and installs them with the header and files for pkg-config and CMake:
#
#     tools/install.sh                          under /usr/local
#     PREFIX=DIR DESTDIR=DIR tools/install.sh   under another prefix, or below a staging folder
#     PROFILE=dev tools/install.sh              as quickly built, for tests
#
# The dynamic library is linked from the static one, with a SONAME and versioned symbols, of which only the functions of the header are
# exported. Debug lines go to libvolraster.so.VERSION.debug where objcopy can split them; the libraries have none.
set -euo pipefail
cd "$(dirname "$0")/.."

prefix=${PREFIX:-/usr/local} profile=${PROFILE:-release}
case $prefix in /*) ;; *) echo "install: PREFIX=$prefix: must be an absolute path" >&2 && exit 2 ;; esac
root=${DESTDIR:-}$prefix
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
# Before version 1 each minor version has an interface of its own.
abi=$(echo "$version" | sed -E 's/^0\.([0-9]+)\..*/0.\1/; s/^([1-9][0-9]*)\..*/\1/')
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo rustc --profile "$profile" -p volraster-capi --crate-type staticlib -- --print native-static-libs 2>&1 |
    tee "$scratch/build" | grep -v 'native-static-libs' || true
folder=$profile
[ "$profile" != dev ] || folder=debug
archive=${CARGO_TARGET_DIR:-target}/$folder/libvolraster.a
[ -f "$archive" ] || { cat "$scratch/build" >&2 && echo "install: the build made no $archive" >&2 && exit 1; }
# What the static library needs of the system. A build that had nothing to do does not tell.
system=$(sed -n 's/.*native-static-libs: //p' "$scratch/build" | tail -n 1)
system=${system:-"-lgcc_s -lutil -lrt -lpthread -lm -ldl -lc"}

printf 'VOLRASTER_%s { global: vr_*; local: *; };\n' "$abi" >"$scratch/symbols"
shared=libvolraster.so.$version
# shellcheck disable=SC2086 # several libraries
${CC:-cc} -shared -o "$scratch/$shared" -Wl,--whole-archive "$archive" -Wl,--no-whole-archive -Wl,--gc-sections \
    -Wl,--version-script="$scratch/symbols" -Wl,-soname,"libvolraster.so.$abi" -Wl,-z,defs $system

install -d "$root/include" "$root/lib/pkgconfig" "$root/lib/cmake/volraster"
install -m 644 include/volraster.h "$root/include/volraster.h"
objcopy --only-keep-debug "$scratch/$shared" "$root/lib/$shared.debug"
objcopy --strip-debug --add-gnu-debuglink="$root/lib/$shared.debug" "$scratch/$shared" "$scratch/stripped"
install -m 755 "$scratch/stripped" "$root/lib/$shared"
ln -sf "$shared" "$root/lib/libvolraster.so.$abi"
ln -sf "libvolraster.so.$abi" "$root/lib/libvolraster.so"
objcopy --strip-debug "$archive" "$scratch/libvolraster.a"
install -m 644 "$scratch/libvolraster.a" "$root/lib/libvolraster.a"

# Places are relative to the files themselves, so that the prefix may be moved.
cat >"$root/lib/pkgconfig/volraster.pc" <<END
prefix=\${pcfiledir}/../..
Name: volraster
Description: Direct volume rendering in object order on explicit Vulkan
Version: $version
Cflags: -I\${prefix}/include
Libs: -L\${prefix}/lib -lvolraster
Libs.private: $system
END
cat >"$root/lib/cmake/volraster/volraster-config.cmake" <<END
# Targets: volraster::volraster, the dynamic library, and volraster::static.
include(CMakeFindDependencyMacro)
find_dependency(Vulkan)
get_filename_component(_volraster_prefix "\${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET volraster::volraster)
  add_library(volraster::volraster SHARED IMPORTED)
  set_target_properties(volraster::volraster PROPERTIES
    IMPORTED_LOCATION "\${_volraster_prefix}/lib/$shared"
    IMPORTED_SONAME "libvolraster.so.$abi"
    INTERFACE_INCLUDE_DIRECTORIES "\${_volraster_prefix}/include"
    INTERFACE_LINK_LIBRARIES Vulkan::Vulkan)
  add_library(volraster::static STATIC IMPORTED)
  set_target_properties(volraster::static PROPERTIES
    IMPORTED_LOCATION "\${_volraster_prefix}/lib/libvolraster.a"
    INTERFACE_INCLUDE_DIRECTORIES "\${_volraster_prefix}/include"
    INTERFACE_LINK_LIBRARIES "Vulkan::Vulkan;$(echo "$system" | sed 's/ /;/g')")
endif()
unset(_volraster_prefix)
END
cat >"$root/lib/cmake/volraster/volraster-config-version.cmake" <<END
set(PACKAGE_VERSION $version)
if(PACKAGE_FIND_VERSION VERSION_GREATER PACKAGE_VERSION OR NOT PACKAGE_VERSION MATCHES "^$(echo "$abi" | sed 's/\./\\\\./')[.]")
  set(PACKAGE_VERSION_COMPATIBLE FALSE)
else()
  string(REGEX MATCH "^$(echo "$abi" | sed -E 's/[0-9]+/[0-9]+/g; s/\./[.]/')" _volraster_wanted "\${PACKAGE_FIND_VERSION}")
  if(NOT PACKAGE_FIND_VERSION OR _volraster_wanted STREQUAL "$abi")
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
  endif()
  if(PACKAGE_FIND_VERSION STREQUAL PACKAGE_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
END
printf 'installed %s: %s, %s, header, pkg-config and CMake files\n' "$root" "$shared" libvolraster.a
