#!/usr/bin/env bash
# Runs every bench of the workspace. Each checks its results before it prints a time.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo bench --workspace --locked --bench '*' "$@"
.venv/bin/python scripts/load_time.py
