#!/usr/bin/env bash
# Runs the project's checks one after the other and closes with a summary; fails when one failed.
#
#   scripts/test.sh         everything
#   scripts/test.sh lint    formats, lints, direction of imports
#   scripts/test.sh format  rewrites sources in the project's format
#
# Needs a checkout prepared by scripts/setup.sh --tools. Logs go to out/test/.
set -uo pipefail
cd "$(dirname "$0")/.."
bin=$PWD/.venv/bin
logs=out/test

cpp_files() { # C and C++ sources that people write; the ABI header is generated
    git ls-files --cached --others --exclude-standard \
        '*.c' '*.cc' '*.cpp' '*.h' '*.hpp' ':!:ffi/capi/include/hdtrapeze.h'
}

names=() results=() passed=0 failed=0 skipped=0

# Adds the counts that cargo test and pytest close with.
count_tests() {
    local counts var word
    counts=$(awk '/^test result: / { p += $4; f += $6; s += $8 } END { print p + 0, f + 0, s + 0 }' "$1")
    read -r -a counts <<<"$counts"
    passed=$((passed + counts[0])) failed=$((failed + counts[1])) skipped=$((skipped + counts[2]))
    counts=$(grep -E '^(=+ )?[0-9]+ (passed|failed|errors?|skipped|xfailed).* in [0-9.]+s' "$1" | tail -n1)
    while read -r var word; do
        if [[ $counts =~ ([0-9]+)\ $word ]]; then
            declare -g "$var=$((${!var} + BASH_REMATCH[1]))"
        fi
    done <<<'passed passed
failed failed
failed error
skipped skipped
skipped xfailed'
}

step() { # step NAME COMMAND...
    local name=$1 log=$logs/$1.log start=$SECONDS rc
    shift
    echo "== $name: $*"
    "$@" 2>&1 | tee "$log"
    rc=${PIPESTATUS[0]}
    count_tests "$log"
    names+=("$name")
    if [ "$rc" = 0 ]; then
        results+=("ok      $((SECONDS - start)) s")
    else
        results+=("FAILED  $((SECONDS - start)) s, exit $rc, $log")
        bad=1
    fi
}

clang_format() {
    mapfile -t files < <(cpp_files)
    [ ${#files[@]} -gt 0 ] || return 0
    "$bin/clang-format" "$@" "${files[@]}"
}

rustdoc() { RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked; }

py_tests() {
    "$bin/python" -m pytest tests/python -q -ra --durations=10
}

hydra_tests() {
    "$bin/python" -m pytest tests/hydra -q -ra --durations=10
}

bad=0
mkdir -p "$logs"

lint() {
    step rustfmt cargo fmt --all --check
    step layers "$bin/python" scripts/check_layers.py
    step ruff "$bin/ruff" check .
    step ruff-format "$bin/ruff" format --check .
    step clang-format clang_format --dry-run --Werror
    step clippy cargo clippy --workspace --all-targets --locked -- -D warnings
}

case ${1:-all} in
format)
    cargo fmt --all && "$bin/ruff" check --fix . && "$bin/ruff" format . && clang_format -i
    exit
    ;;
lint) lint ;;
all)
    lint
    step cargo-test cargo test --workspace --locked
    step pytest py_tests
    # Where no OpenUSD is configured, the tests say so and are skipped.
    if [ -n "${OPENUSD_ROOT:-}${OPENUSD_INCLUDE_DIR:-}" ]; then step hydra-build scripts/hydra.sh; fi
    step hydra hydra_tests
    step rustdoc rustdoc
    ;;
*) echo "test: unknown part $1" >&2 && exit 2 ;;
esac

echo
echo "Summary ($SECONDS s)"
for i in "${!names[@]}"; do printf '  %-13s %s\n' "${names[$i]}" "${results[$i]}"; done
if [ "${1:-all}" = all ]; then
    if [ $((passed + failed)) = 0 ]; then
        echo "  no test was run"
        bad=1
    fi
    echo "$passed passed, $failed failed, $skipped skipped"
fi
exit $bad
