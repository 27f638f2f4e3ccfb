"""What calls of the C ABI point to: numpy arrays and texts, kept alive while the call runs."""

import numpy as np

from . import native
from .named import settings_struct
from .points import Samples

ffi = native.ffi

ARRAY_TYPES = {np.dtype(np.float32): "float[]", np.dtype(np.float64): "double[]"}
ARRAY_TYPES |= {np.dtype(np.int32): "int32_t[]", np.dtype(np.uint32): "uint32_t[]"}
ARRAY_TYPES[np.dtype(np.uint8)] = "uint8_t[]"


class Arrays:
    """Pointers to numpy arrays and texts, kept alive together."""

    def __init__(self):
        self._keep = []

    def pointer(self, array: np.ndarray):
        """A pointer to the array's memory; NULL where it is empty."""
        array = np.ascontiguousarray(array)
        if array.size == 0:
            return ffi.NULL
        pointer = ffi.from_buffer(ARRAY_TYPES[array.dtype], array)
        self._keep.append((array, pointer))
        return pointer

    def samples(self, samples: Samples, of: str = "float") -> tuple:
        """Times, their number, arrays and the number of values of each, as C has them."""
        times = self.pointer(np.asarray(samples.times, dtype=np.float64))
        pointers = [self.pointer(array) for array in samples.arrays]
        values = self.keep(ffi.new(f"{of} *[]", pointers))
        counts = self.keep(ffi.new("size_t[]", [len(array) for array in samples.arrays]))
        return times, len(samples.arrays), values, counts

    def bytes(self, array: np.ndarray):
        """A pointer to an array of any type; NULL where it is empty."""
        array = np.ascontiguousarray(array)
        if array.size == 0:
            return ffi.NULL
        self._keep.append(array)
        return ffi.cast("void *", array.ctypes.data)

    def keep(self, value):
        """Keeps a cffi allocation alive."""
        self._keep.append(value)
        return value

    def settings(self, named: dict, fields: dict):
        """A pointer to a trz_settings with settings by name, and fields."""
        value = self.keep(settings_struct(named))
        for name, field in fields.items():
            setattr(value, name, field)
        return value

    def text(self, value: str):
        """A pointer to a text; NULL where it is empty."""
        return self.keep(ffi.new("char[]", text(value))) if value else ffi.NULL

    def texts(self, values: list[str]):
        """A pointer to pointers to texts; NULL where there are none."""
        pointers = [self.keep(ffi.new("char[]", text(value))) for value in values]
        return self.keep(ffi.new("char *[]", pointers)) if pointers else ffi.NULL


def text(value: str) -> bytes:
    """A text as C has it."""
    return value.encode("utf-8")
