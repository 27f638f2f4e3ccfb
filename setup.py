"""Builds the renderer's shared library with cargo and puts it into the Python package.

`pip install .` runs `cargo build --release` for the crate of the C ABI and installs the library and
its header as hdtrapeze/_native. An editable install (`pip install -e .`) builds nothing: the
package then loads the library from target/release of the checkout, as hdtrapeze/native.py says.
"""

import json
import shutil
import subprocess
import tomllib
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
CRATE = "hdtrapeze-capi"
HEADER = ROOT / "ffi/capi/include/hdtrapeze.h"
LIBRARY_SUFFIXES = (".so", ".dylib", ".dll")


def workspace_version() -> str:
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text())
    return manifest["workspace"]["package"]["version"]


def build_library() -> Path:
    """Builds the crate and returns the shared library's path, as cargo reports it."""
    if shutil.which("cargo") is None:
        raise SystemExit(
            "hdtrapeze: cargo is not on PATH. Install Rust with rustup, then try again."
        )
    command = ["cargo", "build", "--release", "--locked", "-p", CRATE]
    command.append("--message-format=json-render-diagnostics")
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"hdtrapeze: {' '.join(command[:-1])} failed with {done.returncode}")
    for line in done.stdout.splitlines():
        message = json.loads(line)
        if message.get("reason") != "compiler-artifact" or CRATE not in message["package_id"]:
            continue
        for name in message["filenames"]:
            if name.endswith(LIBRARY_SUFFIXES):
                return Path(name)
    raise SystemExit(f"hdtrapeze: cargo built no shared library for {CRATE}")


class BuildWithLibrary(build_py):
    """Copies the Python files, then the library and its header."""

    def run(self):
        super().run()
        if self.editable_mode:
            return
        library = build_library()
        native = Path(self.build_lib) / "hdtrapeze" / "_native"
        native.mkdir(parents=True, exist_ok=True)
        shutil.copy2(library, native / library.name)
        shutil.copy2(HEADER, native / HEADER.name)


class PlatformWheel(bdist_wheel):
    """A wheel for this platform and any Python 3: the library knows nothing of Python's ABI."""

    def get_tag(self):
        _, _, platform = super().get_tag()
        return "py3", "none", platform


class NativeDistribution(Distribution):
    """Says that the package is not pure Python, so that it lands in the platform's folder."""

    def has_ext_modules(self):
        return True


setup(
    version=workspace_version(),
    cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": PlatformWheel},
    distclass=NativeDistribution,
)
