#!/usr/bin/env bash
# Measures again what docs/bvh.md shows, into docs/figures. For an idle machine with 24 GiB; everything takes
# some hours on two cores, most of it the comparisons with Embree (peers, largest). What is not installed is
# left out: Embree's columns, instruction counts. Each file stays as it is until the new one is whole. gpu.md is not
# made here, but by hand on a machine with a GPU, by the commands that it names.
#
#   scripts/figures.sh          everything
#   scripts/figures.sh NAME...  of: peers, frames, largest, scale, effects, segments, hunts, occlusion
# shellcheck disable=SC2016 # backticks and dollars in single quotes are Markdown's and sed's
set -euo pipefail
cd "$(dirname "$0")/.."
parts=(peers frames largest scale effects segments hunts occlusion)
out=docs/figures

read -ra asked <<<"$*"
for part in "${asked[@]}"; do
    if [[ " ${parts[*]} " != *" $part "* ]]; then
        echo "figures: unknown part $part, there are: ${parts[*]}" >&2
        exit 2
    fi
done
[ ${#asked[@]} -gt 0 ] || asked=("${parts[@]}")

mkdir -p $out out
work=$(mktemp -d out/figures.XXXXXX)
leave() {
    local rc=$?
    if [ $rc = 0 ]; then
        rm -rf "$work"
    else
        echo "figures: what was measured until it failed is in $work" >&2
    fi
}
trap leave EXIT
# So that what is there when it is stopped is kept, too.
trap 'exit 130' INT
trap 'exit 143' TERM

# What ran, where and when, above a table.
told() {
    printf '`%s`, %s, %s threads, %s.\n\n' "$1" "$(python3 scripts/processor.py)" "$(nproc)" "$(date +%F)"
}

# keep FILE: $work/whole becomes FILE.
keep() { mv "$work/whole" "$1"; }

# compare FILE FLAGS...: the bench beside Embree.
compare() {
    local file=$1 table=$work/${1##*/}
    shift
    cargo run --release --locked -q -p hdtrapeze-peers -- "$@" --markdown "$table"
    { told "make peers PEERS_FLAGS=\"$*\"" && cat "$table"; } >"$work/whole"
    keep "$file"
}

peers() {
    compare $out/peers-1m.md --size 1 --rounds 3 --scene sheet --scene patches --scene fur
    compare $out/peers-fur.md --size 1 --order block --samples 4 --rounds 2 --image 640 360 --scene fur
    compare $out/peers-combed.md --size 1 --rounds 2 --scene combed
    compare $out/peers-16m.md --size 16 --rounds 2 --scene sheet --scene patches
    # Embree's rates are so low here that fewer rays are enough: of a part of the same picture, so that as many meet in a pixel.
    compare $out/peers-16m-fur.md --size 16 --image 480 272 --across 1280 --rounds 2 --scene fur
}

# The table of oriented frames, the last without Embree, of all scenes.
frames() {
    local flags='--size 1 --order block --rounds 5 --alone --frames' table=$work/frames.md
    # shellcheck disable=SC2086 # flags are words
    cargo run --release --locked -q -p hdtrapeze-peers -- $flags --markdown "$table"
    {
        told "make peers PEERS_FLAGS=\"$flags\""
        sed -n '3,4p;/^### Oriented frames/,$p' "$table"
    } >"$work/whole"
    keep $out/frames.md
}

largest() { compare $out/largest.md --largest --samples 4 --rounds 2; }

scale() { .venv/bin/python scripts/plot_scale.py --peers '--rounds 5'; }

effects() { .venv/bin/python scripts/absent_effects.py --markdown $out/absent_effects.md; }

segments() {
    local log=$work/segments.log
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
    } >"$work/whole"
    keep $out/segments.md
}

hunts() {
    local log=$work/hunts.log
    HDTRAPEZE_HUNT=100 cargo test --locked -q -p hdtrapeze-core --test hunt -- \
        --nocapture --test-threads=1 | tee "$log"
    {
        printf '### Hunts for counterexamples\n\n'
        told "HDTRAPEZE_HUNT=100 cargo test -p hdtrapeze-core --test hunt -- --nocapture"
        printf 'Of a pad, the most that any candidate used; above 1, a bound would not hold.\n'
        printf 'Bounds of inner keys and of conditions touch what they bound where it is an end itself: 1.\n\n'
        printf '| what | most used | candidates |\n|---|---|---|\n'
        sed -nE 's/^\.*(.*): worst ([0-9.-]+) of the pad, ([0-9]+) tried$/| \1 | \2 | \3 |/p' "$log"
    } >"$work/whole"
    keep $out/hunts.md
}

occlusion() {
    local log=$work/occlusion.log
    cargo bench --locked -q -p hdtrapeze-osd --bench occlusion | tee "$log"
    {
        printf '### Occlusion culling\n\n'
        told "cargo bench -p hdtrapeze-osd --bench occlusion"
        printf 'Each scene without culling and with it, in a process of its own; all AOVs have the same bits.\n'
        sed -nE '/samples a pixel/{s/$/./p;q}' "$log"
        printf 'Micropolygons that were diced, and those that were culled, in millions; clusters that were diced, of all.\n'
        printf 'Seconds by the clock on the wall of dicing and of building; of all threads together of the first image, with\n'
        printf 'both, and of the same image again from what is diced by then, best of three. Megabytes of geometry with its\n'
        printf 'BVH, and the most of the process.\n\n'
        printf '| scene | culling | M quads | culled | clusters | dicing s | building s | first s | again s | MB | peak MB |\n'
        printf '|---|---|---|---|---|---|---|---|---|---|---|\n'
        awk '$2 == "off" || $2 == "on" { $1 = $1; gsub(/ /, " | "); print "| " $0 " |" }' "$log"
    } >"$work/whole"
    keep $out/occlusion.md
}

for part in "${asked[@]}"; do "$part"; done
