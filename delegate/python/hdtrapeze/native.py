"""Loads the renderer's shared library and its header.

The header is parsed at run time (cffi, ABI mode), from the copy that belongs to the library, so
the layouts of structs cannot drift from what the library was built with.

Where the library is looked for, in order: the environment variable HDTRAPEZE_LIBRARY; the
installed package; target/release of the checkout (CARGO_TARGET_DIR is honoured).
"""

import functools
import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import cffi

from .errors import HdTrapezeError, NativeError

_PACKAGE = Path(__file__).resolve().parent
_CHECKOUT = _PACKAGE.parents[2]
_SUFFIX = {"darwin": ".dylib", "win32": ".dll"}.get(sys.platform, ".so")
_NAMES = tuple(
    ("" if sys.platform == "win32" else "lib") + stem + _SUFFIX
    for stem in ("hdtrapeze_capi", "hdtrapeze")
)
_HEADER = "hdtrapeze.h"

ffi = cffi.FFI()


def _candidates() -> list[tuple[Path, Path]]:
    """Pairs of library and header, in the order of preference."""
    source_header = _CHECKOUT / "ffi/capi/include" / _HEADER
    override = os.environ.get("HDTRAPEZE_LIBRARY")
    if override:
        library = Path(override)
        beside = library.parent / _HEADER
        return [(library, beside if beside.is_file() else source_header)]
    pairs = [(_PACKAGE / "_native" / name, _PACKAGE / "_native" / _HEADER) for name in _NAMES]
    target = Path(os.environ.get("CARGO_TARGET_DIR", _CHECKOUT / "target"))
    return pairs + [(target / "release" / name, source_header) for name in _NAMES]


def _find() -> tuple[Path, Path]:
    candidates = _candidates()
    for library, header in candidates:
        if library.is_file() and header.is_file():
            return library, header
    looked = "\n".join(f"    {library}" for library, _ in candidates)
    raise HdTrapezeError(
        f"The renderer's shared library was not found. Build it with "
        f"`cargo build --release -p hdtrapeze-capi`, or name it in HDTRAPEZE_LIBRARY. "
        f"Looked for:\n{looked}"
    )


def parse_header(text: str) -> tuple[str, dict[str, int]]:
    """Splits a C header into declarations that cffi reads and its integer #define constants.

    Blocks for C++ are dropped; other preprocessor lines are dropped one by one.
    """
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
    text = re.sub(r"//[^\n]*", "", text).replace("\\\n", " ")
    lines, constants = [], {}
    depth = skipping = 0
    for line in text.splitlines():
        directive = re.match(r"\s*#\s*(\w+)\s*(.*)", line)
        if directive is None:
            if not skipping:
                lines.append(line)
            continue
        word, rest = directive.groups()
        if word in ("if", "ifdef", "ifndef"):
            depth += 1
            if not skipping and word != "ifndef" and "__cplusplus" in rest:
                skipping = depth
        elif word in ("else", "elif"):
            if skipping == depth:
                skipping = 0
        elif word == "endif":
            if skipping == depth:
                skipping = 0
            depth -= 1
        elif word == "define" and not skipping:
            constant = re.match(r"(\w+)\s+\(*\s*(?:\(\w+\))?\s*(-?(?:0[xX][0-9a-fA-F]+|\d+))", rest)
            if constant:
                constants[constant.group(1)] = int(constant.group(2), 0)
    return "\n".join(lines), constants


def _enum_constants(declarations: str) -> dict[str, int]:
    """Members of enums with explicit values."""
    found = {}
    for body in re.findall(r"enum\s*\w*\s*\{(.*?)\}", declarations, flags=re.DOTALL):
        for name, value in re.findall(r"(\w+)\s*=\s*(-?(?:0[xX][0-9a-fA-F]+|\d+))", body):
            found[name] = int(value, 0)
    return found


@functools.cache
def _load():
    library, header = _find()
    declarations, constants = parse_header(header.read_text(encoding="utf-8"))
    constants |= _enum_constants(declarations)
    ffi.cdef(declarations)
    try:
        lib = ffi.dlopen(str(library))
    except OSError as error:
        raise HdTrapezeError(f"{library} cannot be loaded: {error}") from error
    expected = constants.get("TRZ_ABI_VERSION")
    if expected is not None and lib.trz_abi_version() != expected:
        raise HdTrapezeError(
            f"{library} has ABI version {lib.trz_abi_version()}, but {header} is of version "
            f"{expected}. Build the library again."
        )
    return SimpleNamespace(
        lib=lib, constants=SimpleNamespace(**constants), path=library, header=header
    )


def lib():
    """The library's functions."""
    return _load().lib


def constants():
    """The header's constants as attributes, TRZ_OK and so on."""
    return _load().constants


def library_path() -> Path:
    """The library that is loaded."""
    return _load().path


def version() -> str:
    """The renderer's version."""
    return ffi.string(lib().trz_version()).decode()


def new(struct: str):
    """A zeroed struct with its struct_size set."""
    lib()  # the header must be parsed before its types are known
    value = ffi.new(f"{struct} *")
    value.struct_size = ffi.sizeof(struct)
    return value


def check(result: int) -> None:
    """Raises NativeError unless `result` is TRZ_OK."""
    if result == constants().TRZ_OK:
        return
    message = ffi.string(lib().trz_last_error()).decode("utf-8", "replace")
    name = ffi.string(lib().trz_result_name(result)).decode()
    raise NativeError(result, name, message)


def next_on_path(kind: str, times: list, start: int, values: list) -> tuple[list, list[bool]]:
    """Where a path that is known at `times`, the first `start` of them its corners, is to be
    evaluated next; nothing where it is known well enough: then which of them are kept.

    `values` are contiguous arrays of doubles, of whichever shape; `kind` is a TRZ_PATH_ name.
    """
    path = new("trz_path")
    path.of = getattr(constants(), f"TRZ_PATH_{kind}")
    path.times = at = ffi.new("double[]", times)
    path.start_count, path.known_count = start, len(times)
    path.values = arrays = ffi.new("double *[]", len(times))
    for i, value in enumerate(values):
        arrays[i] = ffi.from_buffer("double[]", value)
    path.element_count = values[0].size // (3 if kind == "POINTS" else 16)
    missing, count = ffi.new("double[64]"), ffi.new("size_t *")
    keep = ffi.new("uint8_t[]", len(times))
    check(lib().trz_path_next(path, missing, len(missing), count, keep))
    del at, arrays  # until here, the struct points to them
    return ffi.unpack(missing, count[0]) if count[0] else [], [byte != 0 for byte in keep]
