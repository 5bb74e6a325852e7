#!/usr/bin/env bash
# Installs the libraries into a folder of its own, and builds and runs the C++ example against them, outside of the tree, with CMake and with
# pkg-config, dynamically and statically. Fails too where other symbols than those of the header are exported.
set -euo pipefail
cd "$(dirname "$0")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export PROFILE=${PROFILE:-dev}
PREFIX=$scratch/first tools/install.sh
# The prefix may be moved.
mv "$scratch/first" "$scratch/prefix"
cp -r examples/cpp "$scratch/source"
cd "$scratch"
fail() { printf 'test-install: %s\n' "$*" >&2 && exit 1; }

library=$(echo prefix/lib/libvolraster.so.*.*.?)
readelf -d "$library" | grep -q 'SONAME.*libvolraster\.so\.' || fail "no SONAME"
exported=$(nm -D --defined-only "$library" | awk '$2 != "A" { print $3 }')
[ "$(echo "$exported" | grep -c '^vr_[a-z_]*@@VOLRASTER_')" -gt 30 ] || fail "too few functions: $exported"
! echo "$exported" | grep -v '^vr_[a-z_]*@@VOLRASTER_' || fail "exports other symbols"
declared=$(grep -oE '\bvr_[a-z_]+\(' prefix/include/volraster.h | tr -d '(' | sort -u)
[ "$(echo "$exported" | sed 's/@.*//' | sort -u)" = "$declared" ] || fail "exports and header differ"

warnings=(-Wall -Wextra -Wpedantic -Werror)
for language in c-c11 c++-c++17; do
    echo '#include <volraster.h>' | ${CC:-cc} -fsyntax-only -x "${language%-*}" -std="${language##*-}" "${warnings[@]}" -Iprefix/include - ||
        fail "the header as $language"
done
export LD_LIBRARY_PATH=$PWD/prefix/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} PKG_CONFIG_PATH=$PWD/prefix/lib/pkgconfig
cmake -S source -B build -DCMAKE_PREFIX_PATH="$PWD/prefix" >cmake.log 2>&1 && cmake --build build >>cmake.log 2>&1 || { cat cmake.log && fail "CMake"; }
build/draw - cmake.ppm
flags=$(pkg-config --cflags --libs volraster)
# shellcheck disable=SC2086 # several flags
${CXX:-c++} -std=c++17 "${warnings[@]}" source/draw.cpp -o dynamic $flags
./dynamic - dynamic.ppm
# shellcheck disable=SC2046
${CXX:-c++} -std=c++17 source/draw.cpp -o static $(pkg-config --cflags volraster) prefix/lib/libvolraster.a \
    $(pkg-config --static --libs-only-l volraster | sed 's/-lvolraster//')
LD_LIBRARY_PATH='' ./static - static.ppm
cmp cmake.ppm dynamic.ppm && cmp cmake.ppm static.ppm || fail "the pictures differ"

# Under AddressSanitizer and valgrind: no wrong access, and nothing of the library's is lost. Without layers, and with the driver loaded to the end,
# so that what these lose is known as theirs.
root=$OLDPWD
driver=$(sed -n 's/.*"library_path": *"\(.*\)".*/\1/p' "${VK_DRIVER_FILES:-/dev/null}" 2>/dev/null || true)
alone=(env VK_LOADER_LAYERS_DISABLE='~all~')
sanitized() { # NAME COMPILER SOURCE ARGUMENT...
    local name=$1 compiler=$2 source=$3
    shift 3
    # shellcheck disable=SC2086
    $compiler -g -fsanitize=address,undefined -fno-sanitize-recover=all "$source" -o "$name-asan" $flags -lvulkan -lm
    ASAN_OPTIONS=detect_leaks=0 "${alone[@]}" "./$name-asan" "$@" >"$name.log" 2>&1 || { cat "$name.log" && fail "$name under AddressSanitizer"; }
    # shellcheck disable=SC2086
    $compiler -g "$source" -o "$name-plain" $flags -lvulkan -lm
    "${alone[@]}" ${driver:+LD_PRELOAD="$driver"} valgrind -q --suppressions="$root/tools/valgrind.supp" --leak-check=full \
        --errors-for-leak-kinds=definite,possible --show-leak-kinds=definite,possible --error-exitcode=9 --num-callers=40 \
        "./$name-plain" "$@" >"$name.log" 2>&1 || { cat "$name.log" && fail "$name under valgrind"; }
}
sanitized embed "${CC:-cc} -std=c11" "$root/examples/c/embed.c" embed.ppm "$root/assets/head.json"
sanitized draw "${CXX:-c++} -std=c++17" source/draw.cpp - draw.ppm

echo "installed, built and run: CMake, pkg-config, static, sanitized; $(echo "$declared" | wc -l) functions"
