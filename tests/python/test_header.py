"""The C header is read as it is: declarations for cffi, constants by their names."""

import shutil
import subprocess

import cffi
import pytest
from hdtrapeze import native
from hdtrapeze.native import parse_header

HEADER = """
#ifndef GUARD_H
#define GUARD_H
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif // __cplusplus
/* a comment with #define NOT_THIS 4 */
#define TRZ_OK 0
#define TRZ_MINUS -7
#define TRZ_CAST ((uint32_t)0x10)
typedef struct pair { uint32_t struct_size; const float *values; } pair; // about it
int32_t use(const pair *);
#ifdef __cplusplus
}
#endif
#endif
"""


def test_constants_and_declarations():
    declarations, constants = parse_header(HEADER)
    assert constants == {"TRZ_OK": 0, "TRZ_MINUS": -7, "TRZ_CAST": 16}
    ffi = cffi.FFI()
    ffi.cdef(declarations)
    assert ffi.sizeof("pair") == 16


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm (binutils) is not installed")
def test_the_library_exports_the_abi_and_nothing_else():
    command = ["nm", "-D", "--defined-only", str(native.library_path())]
    listing = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    names = [line.split()[-1] for line in listing.splitlines()]
    assert len(names) > 30
    assert [name for name in names if not name.startswith("trz_")] == []
