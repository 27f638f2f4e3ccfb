"""The check on the direction of imports finds what it is for."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("check_layers", ROOT / "scripts/check_layers.py")
check_layers = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_layers)


def package(name, *dependencies, lib=None):
    return {
        "name": name,
        "targets": [{"name": lib or name.replace("-", "_"), "kind": ["lib"]}],
        "dependencies": [{"name": d} for d in dependencies],
    }


def test_the_intended_direction_passes():
    packages = [
        package("hdtrapeze-shaders", "bytemuck"),
        package("hdtrapeze-core", "hdtrapeze-simd", "hdtrapeze-pages"),
        package("hdtrapeze-gpu", "hdtrapeze-core", "hdtrapeze-shaders", "wgpu"),
        package("hdtrapeze-osd", "hdtrapeze-core", "cxx"),
        package("hdtrapeze-delegate", "hdtrapeze-core", "hdtrapeze-gpu"),
        package("hdtrapeze-capi", "hdtrapeze-core", "hdtrapeze-osd", "hdtrapeze-delegate"),
    ]
    assert check_layers.dependency_errors(packages) == []


@pytest.mark.parametrize(
    "wrong",
    [
        package("hdtrapeze-shaders", "hdtrapeze-core"),
        package("hdtrapeze-core", "hdtrapeze-osd"),
        package("hdtrapeze-core", "hdtrapeze-delegate"),
        package("hdtrapeze-delegate", "hdtrapeze-osd"),
        package("hdtrapeze-osd", "hdtrapeze-capi"),
        package("hdtrapeze-core", "hdtrapeze-gpu"),
        package("hdtrapeze-core", "wgpu"),
        package("hdtrapeze-delegate", "wgpu"),
        package("hdtrapeze-capi", "cxx"),
        package("core"),
        package("hdtrapeze-core", lib="core"),
        package("hdtrapeze-elsewhere"),
    ],
    ids=lambda p: f"{p['name']}-{'-'.join(d['name'] for d in p['dependencies'])}",
)
def test_a_wrong_direction_is_named(wrong):
    assert len(check_layers.dependency_errors([wrong])) >= 1
