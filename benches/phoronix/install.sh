#!/bin/sh
# Puts the program and its launcher into the current folder, which the suite makes for them. The program comes from
#
#     VOLRASTER_PROGRAM         a program that is built (absolute path), or else
#     VOLRASTER_SOURCE          a checkout (absolute path), which is built, or else
#     the checkout that this file lies in, also by a symbolic link to its folder: it is built, or else
#     volraster-source.tar.gz   an archive in the suite's download cache, which is built here, or else
#     volraster                 on PATH

profile=$(dirname "$(readlink -f "$0")")

fail() {
    echo "error: $1" >&2
    echo 1 >install-exit-status
    exit 1
}

program=$VOLRASTER_PROGRAM
source=$VOLRASTER_SOURCE
if [ -n "$program$source" ]; then
    :
elif grep -qs '^name = "volraster"' "$profile/../../Cargo.toml"; then
    source=$(readlink -f "$profile/../..")
elif [ -f volraster-source.tar.gz ]; then
    rm -rf source
    mkdir source
    tar -xf volraster-source.tar.gz -C source --strip-components=1 || fail "volraster-source.tar.gz cannot be unpacked"
    source=$PWD/source
else
    program=$(command -v volraster) ||
        fail "no volraster: set VOLRASTER_SOURCE to a checkout or VOLRASTER_PROGRAM to the program, or put it on PATH"
fi

if [ -z "$program" ]; then
    # The suite sets HOME to this folder, where rustup and cargo find nothing.
    HOME=${DEBUG_REAL_HOME:-$HOME} CARGO_TARGET_DIR=$source/target make -C "$source" build ||
        fail "$source cannot be built"
    program=$source/target/release/volraster
fi

# A copy: what is measured stays the same when the checkout is built again.
cp "$program" volraster || fail "$program cannot be copied"
./volraster --version || fail "$program does not run"

cat >volraster-bench <<'LAUNCHER'
#!/bin/sh
# Runs `volraster bench` with the given arguments and prints a line for each case, here of one scene and one size:
#
#     slices-3d compute: 18.5310 ms (blobs-64, 512x512, rmse 9.5e-05)
#     havs interlock: - (blobs-tets-12, 512x512, why there is no time)
#
# A name is technique, route, options other than defaults, and the projection unless it is perspective.

here=$(dirname "$0")
# What the suite reads.
if [ -n "$LOG_FILE" ]; then exec >"$LOG_FILE" 2>&1; fi

rm -rf "$here/results"
"$here/volraster" bench "$@" --quiet --csv --output "$here/results" 2>"$here/messages"
# Also not 0 if an image is wrong: the suite then takes no time of this run.
status=$?
echo "$status" >"$here/test-exit-status"
cat "$here/messages" >&2
# The suite shows a line with this word, if it is short.
if [ "$status" -ne 0 ]; then echo "error: $(tail -n 1 "$here/messages" | cut -c 1-240)" >&2; fi
[ -f "$here/results/bench.csv" ] || exit "$status"

LC_ALL=C awk -v footnote="$here/pts-footnote" '
    # Splits a row into cells. A cell with commas is in quotes.
    function split_row(row, cells,    parts, count, i) {
        count = split(row, parts, "\"")
        row = ""
        for (i = 1; i <= count; i++) {
            if (i % 2 == 0) gsub(",", "\001", parts[i])
            row = row parts[i]
        }
        count = split(row, cells, ",")
        for (i = 1; i <= count; i++) gsub("\001", ",", cells[i])
    }
    function cell(name) { return cells[place[name]] }

    NR == 1 {
        split_row($0, names)
        for (i in names) place[names[i]] = i
        next
    }
    {
        split_row($0, cells)
        name = cell("technique") " " cell("route")
        if (cell("options") != "") name = name " " cell("options")
        if (cell("projection") != "perspective") name = name " " cell("projection")
        scene = cell("scene") ", " cell("width") "x" cell("height")
        if (cell("verdict") == "ok")
            printf "%s: %.4f ms (%s, rmse %.1e)\n", name, cell("median_ms"), scene, cell("rmse")
        else
            printf "%s: - (%s, %s)\n", name, scene, cell("verdict")
    }
    # Shown below the graphs: the suite does not know which device was used.
    NR == 2 {
        commit = cell("commit") == "" ? "" : " " cell("commit")
        print "volraster " cell("version") commit " on " cell("device") ", driver " cell("driver") >footnote
    }
' "$here/results/bench.csv"
exit "$status"
LAUNCHER
chmod +x volraster-bench
echo 0 >install-exit-status
