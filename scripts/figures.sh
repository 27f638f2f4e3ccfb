#!/usr/bin/env bash
# Measures again all that docs/bvh.md shows, into docs/figures. For an idle machine with 24 GiB; takes an
# hour or so on two cores. What is not installed is left out: Embree's columns, instruction counts.
#
#   scripts/figures.sh          everything
#   scripts/figures.sh NAME...  of: peers, frames, largest, scale, effects, segments, hunts
set -euo pipefail
cd "$(dirname "$0")/.."
out=docs/figures
mkdir -p $out

# What ran, where and when, above a table.
told() {
    local cpu
    cpu=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n1)
    printf '`%s`, %s, %s threads, %s.\n\n' "$1" "${cpu:-unknown processor}" "$(nproc)" "$(date +%F)"
}

# compare FILE FLAGS...: the bench beside Embree.
compare() {
    local file=$1 table
    shift
    table=$(mktemp)
    cargo run --release --locked -q -p hdtrapeze-peers -- "$@" --markdown "$table"
    { told "make peers PEERS_FLAGS=\"$*\"" && cat "$table"; } >"$file"
    rm -f "$table"
}

peers() {
    compare $out/peers-1m.md --size 1
    compare $out/peers-16m.md --size 16
}

# The table of oriented frames, the last without Embree, of all scenes.
frames() {
    local all=$out/frames.md flags='--size 1 --order block --rounds 5 --alone --frames' table
    table=$(mktemp)
    # shellcheck disable=SC2086 # flags are words
    cargo run --release --locked -q -p hdtrapeze-peers -- $flags --markdown "$table"
    {
        told "make peers PEERS_FLAGS=\"$flags\""
        sed -n '3,4p;/^### Oriented frames/,$p' "$table"
    } >$all
    rm -f "$table"
}

largest() { compare $out/largest.md --largest --samples 4; }

scale() { .venv/bin/python scripts/plot_scale.py; }

effects() { .venv/bin/python scripts/absent_effects.py --markdown $out/absent_effects.md; }

segments() {
    local log
    log=$(mktemp)
    cargo bench --locked -q -p hdtrapeze-core --bench segments | tee "$log"
    {
        printf '### Several segments of motion beside one\n\n'
        told "cargo bench -p hdtrapeze-core --bench segments"
        printf 'A million micropolygons; time and bytes of the BVH as ratios to two keys. Thin lens, packets of 64 rays,\n'
        printf 'one thread, by the clock on the wall; first with 4 samples a pixel, then with 16, whose packets are nearer\n'
        printf 'in time, and so in one segment more often; nodes and micropolygons a ray are of these. Half a turn has no\n'
        printf 'chord: two keys of fan and orbit make an eighth of the others'"'"' turn, and those named slow make that however many keys they have.\n\n'
        sed -n '1{s/^/| /;s/$/ |/;p;s/[^|]*|/---|/g;s/^---|/|/;p}' "$log"
        sed -n '2,${s/^/| /;s/$/ |/;p}' "$log"
    } >$out/segments.md
    rm -f "$log"
}

hunts() {
    local log
    log=$(mktemp)
    HDTRAPEZE_HUNT=100 cargo test --locked -q -p hdtrapeze-core --test hunt -- \
        --nocapture --test-threads=1 | tee "$log"
    {
        printf '### Hunts for counterexamples\n\n'
        told "HDTRAPEZE_HUNT=100 cargo test -p hdtrapeze-core --test hunt -- --nocapture"
        printf 'Of a pad, the most that any candidate used; above 1, a bound would not hold.\n'
        printf 'Bounds of inner keys and of conditions touch what they bound where it is an end itself: 1.\n\n'
        printf '| what | most used | candidates |\n|---|---|---|\n'
        sed -nE 's/^\.*(.*): worst ([0-9.-]+) of the pad, ([0-9]+) tried$/| \1 | \2 | \3 |/p' "$log"
    } >$out/hunts.md
    rm -f "$log"
}

for name in "${@:-peers frames largest scale effects segments hunts}"; do
    for part in $name; do "$part"; done
done
