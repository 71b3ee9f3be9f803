# shellcheck shell=bash
# SPDX-License-Identifier: MIT
# For tests that are shell functions: `judge` runs one, `sum_up` prints "N passed, N failed, N skipped" last. `out` is the folder of their logs.
passed=0 inconclusive=0 failed=0 skipped=0

# judge NAME FUNCTION: status 77 is a skip, and the last line is its reason; 75 is a skip too, and in_real_time prints its reason.
judge() {
    local status=0
    ("$2") >"${out:?}/$2.log" 2>&1 8>&- || status=$?
    case $status in
    0) passed=$((passed + 1)) && echo "ok      $1" ;;
    75) skipped=$((skipped + 1)) inconclusive=$((inconclusive + 1)) && echo "skip: $1: $(sed -n 's/^skip: //p' "$out/$2.log")" ;;
    77) skipped=$((skipped + 1)) && echo "skip: $1: $(tail -n 1 "$out/$2.log")" ;;
    *) failed=$((failed + 1)) && echo "FAILED  $1" && tail -n 20 "$out/$2.log" ;;
    esac
    return $status
}

# in_real_time NAME COMMAND...: status 75 if a stalled machine explains the failure of each attempt.
in_real_time() {
    python3 test/support/verdict.py --run "$@"
}

skip() {
    echo "$*"
    exit 77
}

need() {
    command -v "$1" >/dev/null || skip "$1 is missing (scripts/install_tools check brings it)"
}

# The sources of a release: the files of git, and new files that git does not ignore.
copy_sources() {
    mkdir -p "$1" && git ls-files -z -co --exclude-standard | while IFS= read -r -d '' file; do
        [ -f "$file" ] && [ ! -L "$file" ] && printf '%s\0' "$file"
    done | xargs -0 cp -p --parents -t "$1"
}

sum_up() {
    local unjudged=0
    [ "$inconclusive" -eq 0 ] || echo "$inconclusive inconclusive, counted as skipped: see above"
    [ $((4 * inconclusive)) -le $((passed + failed + skipped)) ] || [ "$failed" -gt 0 ] || unjudged=75
    [ "$unjudged" -eq 0 ] || echo "real time not judged: more than a quarter is inconclusive; run it on a machine that does less"
    echo "$passed passed, $failed failed, $skipped skipped"
    [ "$unjudged" -eq 0 ] || exit "$unjudged"
    [ "$failed" -eq 0 ] && [ $((passed + skipped)) -gt 0 ]
}
