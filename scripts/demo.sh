#!/usr/bin/env bash
# Renders the demo scene to out/demo.exr and out/demo.png. Further arguments go to `hdtrapeze record`.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p out
record() {
    .venv/bin/hdtrapeze record --camera /World/Camera --frames 1:1 --imageWidth 960 "$@"
}
record examples/demo/demo.usda out/demo.exr "$@"
record examples/demo/demo.usda out/demo.png "$@"
echo
echo "The demo is rendered:"
echo "    $PWD/out/demo.exr"
echo "    $PWD/out/demo.png"
