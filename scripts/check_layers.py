"""Holds the direction of imports between the workspace's crates.

shaders <- core <- core/gpu <- delegate <- ffi/capi, core <- ffi/osd <- ffi/capi,
core/simd <- core, core/pages <- core.
Reads `cargo metadata`, so dependencies of every kind count (normal, build and dev). Also: wgpu
belongs to core/gpu alone; cxx to ffi/osd alone; no crate is called `core`, which would shadow
Rust's own; C and C++ outside ffi see only hdtrapeze.h.

Prints each violation and exits with 1; tests/python/test_layers.py holds the check itself.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PREFIX = "hdtrapeze-"

# What each crate of the workspace may depend on inside the workspace.
ALLOWED = {
    "hdtrapeze-shaders": set(),
    "hdtrapeze-simd": set(),
    "hdtrapeze-pages": set(),
    "hdtrapeze-core": {"hdtrapeze-shaders", "hdtrapeze-simd", "hdtrapeze-pages"},
    "hdtrapeze-osd": {"hdtrapeze-core"},
    "hdtrapeze-gpu": {"hdtrapeze-core", "hdtrapeze-shaders"},
    "hdtrapeze-delegate": {"hdtrapeze-core", "hdtrapeze-gpu"},
    "hdtrapeze-capi": {"hdtrapeze-core", "hdtrapeze-osd", "hdtrapeze-delegate"},
    # Tests and examples across crates stand above everything.
    "hdtrapeze-tests": None,
    "hdtrapeze-examples": None,
    "hdtrapeze-peers": None,
}

# Crates from outside that only some of ours may name.
RESERVED = {
    "wgpu": {"hdtrapeze-gpu"},
    "cxx": {"hdtrapeze-osd"},
    "cxx-build": {"hdtrapeze-osd"},
}


def dependency_errors(packages: list[dict]) -> list[str]:
    """Violations in `packages`, the workspace members of a `cargo metadata` document."""
    errors = []
    for package in packages:
        name = package["name"]
        targets = {t["name"] for t in package.get("targets", []) if "lib" in t.get("kind", [])}
        if "core" in {name, *targets}:
            errors.append(f"{name}: a crate called `core` shadows Rust's own")
        if name not in ALLOWED:
            errors.append(f"{name}: unknown crate; give it a layer in scripts/check_layers.py")
            continue
        allowed = ALLOWED[name]
        for dependency in package["dependencies"]:
            used = dependency["name"]
            if used == name:
                continue
            if used.startswith(PREFIX) and allowed is not None and used not in allowed:
                errors.append(f"{name} may not depend on {used}")
            if used in RESERVED and name not in RESERVED[used]:
                errors.append(f"{name} may not depend on {used}")
    return errors


def source_errors(root: Path) -> list[str]:
    """Violations that only sources show."""
    errors = []
    private = re.compile(
        r'#\s*include\s*[<"](?:hdtrapeze[-_](?:core|osd|shaders|delegate)|ffi/osd)'
    )
    for folder in ("delegate/hydra", "examples", "tests"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in {".c", ".cc", ".cpp", ".h", ".hpp"}:
                continue
            if private.search(path.read_text(encoding="utf-8")):
                errors.append(f"{path.relative_to(root)}: sees more than hdtrapeze.h")
    return errors


def main() -> int:
    """Checks this checkout."""
    command = ["cargo", "metadata", "--format-version", "1", "--no-deps", "--locked"]
    output = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    packages = json.loads(output)["packages"]
    errors = dependency_errors(packages) + source_errors(ROOT)
    for error in errors:
        print(f"layers: {error}", file=sys.stderr)
    if not errors:
        print(f"layers: {len(packages)} crates, imports point one way")
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
