#!/usr/bin/env bash
# Makes a fresh Debian or Ubuntu machine able to build and run volraster:
#
#     tools/setup.sh            what building and running need
#     tools/setup.sh --tests    the validation layers, Vulkan's C headers, CMake, pkg-config, valgrind, Python's venv and Open MPI too
#     tools/setup.sh --window   what a window needs at run time, too; with --tests a display without a screen
#
# It installs only what is missing, and does nothing (in well under a second) when all is there.
# The system is touched by apt alone; everything else goes to .deps/ inside the checkout.
#
# VOLRASTER_SHADERC=source skips the distribution's libshaderc and builds the one the shaderc crate
# carries. A SHADERC_LIB_DIR of your own (a Vulkan SDK, say) is left alone.
set -euo pipefail
cd "$(dirname "$0")/.."

shaderc_dir=$PWD/.deps/shaderc
shaderc_lib=$shaderc_dir/libshaderc_combined.a
stamp_file=$shaderc_dir/stamp
recipe=1 # raise it when the way the library is made changes, so that old ones are made again

say() { printf 'setup: %s\n' "$*"; }
die() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}
has() { command -v "$1" >/dev/null 2>&1; }

with_tests=false
with_window=false
for arg in "$@"; do
    case $arg in
    --tests) with_tests=true ;;
    --window) with_window=true ;;
    *) die "unknown argument '$arg' (there are --tests and --window)" ;;
    esac
done

# One folder for temporary files, whichever way the script ends.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# ---------------------------------------------------------------------------------------- cargo

need_rust=$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' Cargo.toml)
has cargo || die "cargo was not found: install Rust $need_rust or newer with rustup, and put ~/.cargo/bin on PATH"
have_rust=$(cargo --version | awk '{print $2}')
have_rust=${have_rust%%-*} # a nightly calls itself 1.97.0-nightly
if [ "$(printf '%s\n%s\n' "$need_rust" "$have_rust" | sort -V | head -n 1)" != "$need_rust" ]; then
    die "cargo is $have_rust, volraster needs $need_rust or newer: rustup update stable"
fi

# ------------------------------------------------------------------------------------- packages

why() {
    case $1 in
    make) echo "the Makefile's targets" ;;
    g++) echo "C++ linker and libstdc++, which the shader compiler needs" ;;
    binutils) echo "ar, to join the shader compiler's libraries" ;;
    libshaderc-dev) echo "the shader compiler, used at build time" ;;
    glslang-dev) echo "the shader compiler's GLSL front end" ;;
    spirv-tools) echo "the shader compiler's optimiser, and spirv-val" ;;
    spirv-tools-dev) echo "the optimiser's static libraries, packed apart on this system" ;;
    libvulkan1) echo "the Vulkan loader" ;;
    mesa-vulkan-drivers) echo "Mesa's drivers, among them lavapipe, which needs no GPU" ;;
    libvulkan-dev) echo "Vulkan's C headers, for the C example that the tests build" ;;
    valgrind) echo "checks of memory in the C and C++ examples" ;;
    libopenmpi-dev | openmpi-bin) echo "Open MPI, by which several processes draw one image" ;;
    libclang-dev) echo "reading MPI's C header" ;;
    python3-venv) echo "a fresh environment, into which the Python package is installed" ;;
    pkgconf) echo "pkg-config, by which a test finds the installed libraries" ;;
    vulkan-validationlayers) echo "the validation layers, which every test runs under" ;;
    libxcursor1 | libxi6 | libxkbcommon-x11-0 | libx11-xcb1) echo "the window on X11" ;;
    libwayland-client0 | libxkbcommon0) echo "the window on Wayland" ;;
    gfxreconstruct) echo "captures, of which the tests make one" ;;
    xvfb) echo "a display without a screen, for tests of the window" ;;
    cmake) echo "building the C++ example, and the shader compiler where it is built from source" ;;
    git | python3 | ninja-build) echo "building the shader compiler from source" ;;
    *) echo "needed" ;;
    esac
}

missing() { # of the packages named, those that are not installed
    local package
    for package in "$@"; do
        # Asked for one by one: dpkg-query fails as a whole when it does not know one of them.
        case $(dpkg-query -W -f '${Status}' "$package" 2>/dev/null || true) in
        'install ok installed') ;;
        *) echo "$package" ;;
        esac
    done
}

apt_updated=false
apt_update() {
    if $apt_updated; then return 0; fi
    apt_updated=true
    # One broken third-party source makes the update fail, though the packages may well be there.
    as_root apt-get update -qq || say "apt-get update reported errors; going on with what it has"
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        DEBIAN_FRONTEND=noninteractive "$@"
    elif [ -t 0 ]; then
        sudo DEBIAN_FRONTEND=noninteractive "$@"
    else
        sudo -n DEBIAN_FRONTEND=noninteractive "$@" # nobody is there to type a password
    fi
}

may_install() { [ "$(id -u)" = 0 ] || has sudo; }

installable() { # does apt offer this package?
    # Read whole first: a grep that has seen enough would end apt-cache by a broken pipe, and pipefail with it.
    local policy
    policy=$(LC_ALL=C apt-cache policy "$1" 2>/dev/null) || return 1
    grep -q 'Candidate: [^(]' <<<"$policy"
}

install() { # packages, all of them missing
    local package command="apt-get install -y --no-install-recommends $*"
    may_install || die "these packages are missing; as root, run: apt-get update && $command"
    say "installing with apt:"
    for package in "$@"; do say "  $package: $(why "$package")"; done
    as_root $command </dev/null >"$scratch/apt.log" 2>&1 || {
        tail -n 20 "$scratch/apt.log" >&2
        die "apt failed; as root, run: apt-get update && $command"
    }
}

# What the program and the tests need at run time, and the compilers: nothing replaces these.
required=(make g++ binutils spirv-tools libvulkan1 mesa-vulkan-drivers)
if $with_tests; then
    required+=(vulkan-validationlayers libvulkan-dev cmake pkgconf python3-venv valgrind libopenmpi-dev openmpi-bin libclang-dev)
fi
if $with_window; then
    required+=(libxcursor1 libxi6 libxkbcommon-x11-0 libx11-xcb1 libwayland-client0 libxkbcommon0)
    if $with_tests; then required+=(xvfb); fi
fi
# The shader compiler: where these are not to be had it is built from source.
compiler=(libshaderc-dev glslang-dev)
# For a test that is skipped without it: newer distributions have none.
wished=()
if $with_tests; then wished=(gfxreconstruct); fi

compiler_from_packages=true
if [ -n "${SHADERC_LIB_DIR:-}" ]; then
    compiler_from_packages=false
    say "SHADERC_LIB_DIR is set: using the shader compiler in $SHADERC_LIB_DIR"
elif [ "${VOLRASTER_SHADERC:-}" = source ] || grep -qs '^source' "$stamp_file"; then
    compiler_from_packages=false
fi

if has apt-get && has dpkg-query; then
    mapfile -t wanted < <(missing "${required[@]}")
    if $compiler_from_packages; then
        mapfile -t wanted_compiler < <(missing "${compiler[@]}")
    else
        wanted_compiler=()
    fi
    mapfile -t wished < <(missing "${wished[@]}")
    if [ $((${#wanted[@]} + ${#wanted_compiler[@]})) -gt 0 ] && may_install; then apt_update; fi
    for package in "${wished[@]}"; do
        if may_install && installable "$package"; then wanted+=("$package"); fi
    done
    if [ $((${#wanted[@]} + ${#wanted_compiler[@]})) -gt 0 ]; then
        if may_install; then
            apt_update
            for package in "${wanted_compiler[@]}"; do
                if ! installable "$package"; then
                    say "$package is not in this system's package lists"
                    compiler_from_packages=false
                fi
            done
        fi
        if $compiler_from_packages; then wanted+=("${wanted_compiler[@]}"); fi
        if [ ${#wanted[@]} -gt 0 ]; then install "${wanted[@]}"; fi
    fi
else
    say "this is no Debian or Ubuntu; please see to these yourself: a C++ compiler, ar, spirv-val," \
        "the Vulkan loader, a Vulkan 1.3 driver (Mesa's lavapipe will do), the validation layers"
    compiler_from_packages=false
fi

# ------------------------------------------------------------------------------ shader compiler
#
# Shaders are compiled by the shaderc crate's build script, which wants one libshaderc. Debian's
# shared library leaves its glslang symbols undefined and cannot be linked, and Debian's
# "combined" archive holds shaderc only. The static archives of the same packages do belong
# together, so they are joined into the one file the crate looks for.

# Proves that a library links from C, optimises, targets Vulkan 1.3 with SPIR-V 1.5, and reports a
# syntax error as an error: all that the build script relies on, optimiser and C++ exceptions
# included.
probe() { # library, include folder
    cat >"$scratch/probe.c" <<'C'
#include <shaderc/shaderc.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static const char good[] =
    "#version 460\n"
    "layout(set = 0, binding = 0) uniform sampler3D volume;\n"
    "layout(location = 0) in vec3 at;\n"
    "layout(location = 0) out vec4 color;\n"
    "float twice(float x) { return x + x; }\n"
    "void main() {\n"
    "    float sum = 0.0;\n"
    "    for (int i = 0; i < 4; ++i) sum += twice(texture(volume, at * float(i)).r);\n"
    "    color = vec4(sum);\n"
    "}\n";
static const char bad[] = "#version 460\nvoid main() { nonsense = 1; }\n";

int main(void) {
    shaderc_compiler_t compiler = shaderc_compiler_initialize();
    shaderc_compile_options_t options = shaderc_compile_options_initialize();
    shaderc_compile_options_set_target_env(options, shaderc_target_env_vulkan,
                                           shaderc_env_version_vulkan_1_3);
    shaderc_compile_options_set_target_spirv(options, shaderc_spirv_version_1_5);
    shaderc_compile_options_set_optimization_level(options,
                                                   shaderc_optimization_level_performance);
    shaderc_compilation_result_t result = shaderc_compile_into_spv(
        compiler, good, strlen(good), shaderc_fragment_shader, "good.frag", "main", options);
    if (shaderc_result_get_compilation_status(result) != shaderc_compilation_status_success) {
        fprintf(stderr, "%s\n", shaderc_result_get_error_message(result));
        return 1;
    }
    uint32_t word[2];
    if (shaderc_result_get_length(result) < 20) return 2;
    memcpy(word, shaderc_result_get_bytes(result), sizeof word);
    if (word[0] != 0x07230203u || word[1] != 0x00010500u) {
        fprintf(stderr, "magic %08x, version %08x\n", word[0], word[1]);
        return 3;
    }
    shaderc_result_release(result);
    result = shaderc_compile_into_spv(compiler, bad, strlen(bad), shaderc_fragment_shader,
                                      "bad.frag", "main", options);
    if (shaderc_result_get_compilation_status(result) !=
            shaderc_compilation_status_compilation_error ||
        strstr(shaderc_result_get_error_message(result), "bad.frag:2") == NULL)
        return 4;
    shaderc_result_release(result);
    shaderc_compile_options_release(options);
    shaderc_compiler_release(compiler);
    return 0;
}
C
    # Compiled as C, linked by the C++ driver, which brings libstdc++.
    cc -I"$2" -c "$scratch/probe.c" -o "$scratch/probe.o" &&
        c++ "$scratch/probe.o" "$1" -lm -lpthread -o "$scratch/probe" &&
        "$scratch/probe"
}

find_archive() { # name: the first libNAME.a in the linker's usual folders
    local folder
    for folder in "/usr/lib/$(c++ -print-multiarch 2>/dev/null || true)" /usr/lib/*-linux-gnu \
        /usr/lib64 /usr/lib; do
        if [ -f "$folder/lib$1.a" ]; then
            echo "$folder/lib$1.a"
            return 0
        fi
    done
    return 1
}

# The crate's build script is not run again when the library changes under the same path, so what
# it built with another library has to go.
forget_old_builds() {
    [ -d target ] || return 0
    cargo clean --quiet -p shaderc-sys 2>/dev/null || true
    cargo clean --quiet --release -p shaderc-sys 2>/dev/null || true
}

put_in_place() { # library, stamp text
    mkdir -p "$shaderc_dir"
    # Beside it first, then renamed: an interrupted copy must not look like a library.
    cp -L "$1" "$shaderc_lib.new"
    mv "$shaderc_lib.new" "$shaderc_lib"
    printf '%s\n' "$2" >"$stamp_file"
    forget_old_builds
}

join_packages() {
    local name path script=$scratch/join.mri parts=0
    # Newer distributions ship some of these no more, older ones need them all; the order is the
    # linker's, users before what they use.
    local names=(shaderc_combined glslang MachineIndependent GenericCodeGen OSDependent OGLCompiler
        SPIRV HLSL SPIRV-Tools-opt SPIRV-Tools)
    find_archive shaderc_combined >/dev/null || return 1
    if ! find_archive SPIRV-Tools-opt >/dev/null && [ -n "$(missing spirv-tools-dev)" ] &&
        may_install; then
        apt_update
        if installable spirv-tools-dev; then install spirv-tools-dev; fi
    fi
    # ar's scripts cannot hold '+' and other characters that a path may have, so the script names
    # links in a folder of its own, relative to it.
    mkdir -p "$scratch/join"
    echo "create all.a" >"$script"
    for name in "${names[@]}"; do
        if path=$(find_archive "$name"); then
            ln -sf "$path" "$scratch/join/$name.a"
            echo "addlib $name.a" >>"$script"
            parts=$((parts + 1))
        fi
    done
    printf 'save\nend\n' >>"$script"
    (cd "$scratch/join" && ar -M <"$script") || return 1
    probe "$scratch/join/all.a" /usr/include || return 1
    put_in_place "$scratch/join/all.a" "$1"
    say "joined $parts of the distribution's archives into .deps/shaderc/libshaderc_combined.a, probe passed"
}

# The same sources and options as the crate's own build-from-source feature, but built once for
# every profile and every clean build, not once each.
build_from_source() {
    local source library tool tools jobs build=$PWD/.deps/shaderc-build
    if has apt-get; then
        mapfile -t tools < <(missing cmake git python3 ninja-build)
        if [ ${#tools[@]} -gt 0 ]; then
            if may_install; then apt_update; fi
            install "${tools[@]}"
        fi
    fi
    for tool in cmake git python3 ninja c++; do
        has "$tool" || die "$tool is needed to build the shader compiler from source"
    done
    # Fetches the crates, too; the manifest's path is the one way to find them that does not
    # depend on where cargo keeps them.
    source=$(cargo metadata --format-version 1 |
        tr ',' '\n' | sed -n 's/.*"manifest_path":"\(.*shaderc-sys[^"]*\)\/Cargo\.toml".*/\1/p' | head -n 1)
    [ -f "$source/build/CMakeLists.txt" ] || die "the shaderc-sys crate's sources were not found"
    jobs=${CARGO_BUILD_JOBS:-$(nproc)}
    say "========================================================================================"
    say "No usable libshaderc: building the shader compiler from the crate's own C++ sources, ONCE."
    say "About 17 minutes of CPU time, on $jobs job(s) here. An interrupted build goes on from there."
    say "========================================================================================"
    # As in the crate's build/build.rs.
    cmake -S "$source/build" -B "$build" -G Ninja \
        -DCMAKE_BUILD_TYPE=Release \
        -DCMAKE_INSTALL_PREFIX="$build/install" -DCMAKE_INSTALL_LIBDIR=lib \
        -DCMAKE_POSITION_INDEPENDENT_CODE=ON \
        -DENABLE_SPVREMAPPER=OFF -DENABLE_GLSLANG_BINARIES=OFF \
        -DSHADERC_SKIP_TESTS=ON \
        -DSPIRV_SKIP_EXECUTABLES=ON -DSPIRV_WERROR=OFF >"$scratch/cmake.log" 2>&1 || {
        tail -n 20 "$scratch/cmake.log" >&2
        die "cmake could not configure the shader compiler"
    }
    # This target alone: the rest of what the crate installs is a third of the work, and not used.
    cmake --build "$build" --parallel "$jobs" --target shaderc_combined
    library=$(find "$build" -name libshaderc_combined.a -print -quit)
    [ -n "$library" ] || die "the build left no libshaderc_combined.a"
    probe "$library" "$source/build/shaderc/libshaderc/include" ||
        die "the shader compiler built from source fails its probe"
    put_in_place "$library" "$1"
    rm -rf "$build"
    say "built .deps/shaderc/libshaderc_combined.a from source, probe passed"
}

if [ -z "${SHADERC_LIB_DIR:-}" ]; then
    if $compiler_from_packages; then
        # Any change of a part, or of the C++ library it is linked with, makes a new one.
        stamp="recipe $recipe $(dpkg-query -W -f '${Package} ${Version}; ' g++ "${compiler[@]}" \
            spirv-tools spirv-tools-dev 2>/dev/null || true)"
    fi
    if [ -f "$shaderc_lib" ] && grep -qs "^source recipe $recipe" "$stamp_file"; then
        : # built from source before, whatever packages came since
    elif $compiler_from_packages && [ -f "$shaderc_lib" ] && [ "$(cat "$stamp_file" 2>/dev/null)" = "$stamp" ]; then
        :
    else
        if ! { $compiler_from_packages && join_packages "$stamp" 2>"$scratch/join.log"; }; then
            if $compiler_from_packages; then
                tail -n 5 "$scratch/join.log" >&2 || true
                say "the distribution's libshaderc does not pass its probe"
            fi
            build_from_source "source recipe $recipe"
        fi
    fi
fi

say "ready: cargo $have_rust, shader compiler in ${SHADERC_LIB_DIR:-.deps/shaderc}"
