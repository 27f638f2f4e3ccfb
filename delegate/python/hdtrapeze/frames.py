"""Frame ranges as usdrecord writes them, and frame numbers in file names.

A frame specification is `start[:end[xstride]]`, several of them joined by commas. The output path
then holds one placeholder: hashes, with a dot and more hashes for fractions (`###`, `###.##`), or
what other renderers write (`<F4>`, `$F4`, `${F4}`, `%04d`). The library fills them in, as in the
names of render products.
"""

import math
import re
from decimal import Decimal

from . import native
from .errors import UsageError

_NUMBER = r"([+-]?(?:\d+(?:\.\d*)?|\.\d+))"
_SPEC = re.compile(rf"{_NUMBER}(?::{_NUMBER}(?:x{_NUMBER})?)?")

MAX_FRAMES = 1_000_000


def parse_frames(specs: str) -> tuple[list[float], int]:
    """Frames of `specs` in order, and the number of decimals that tell them apart."""
    # Parsed here and not by UsdUtils.TimeCodeRange, which crashes on some malformed ranges.
    frames: list[float] = []
    decimals = 0
    for spec in specs.split(","):
        match = _SPEC.fullmatch(spec.strip())
        if match is None:
            raise UsageError(
                f"--frames: {spec!r} is not a frame range. Valid are 12, 1:10, 10:1, 1:10x2 and "
                f"1:2x0.5, or several joined by commas."
            )
        first, last, stride = (None if n is None else Decimal(n) for n in match.groups())
        last = first if last is None else last
        stride = Decimal(1) if stride is None else stride
        # usdrecord wants 10:1x-3; 10:1x3 can mean nothing else.
        backwards = last < first
        if stride == 0 or (stride < 0 and not backwards):
            raise UsageError(f"--frames: the stride of {spec!r} leads nowhere.")
        count = int(abs(last - first) / abs(stride)) + 1
        if count > MAX_FRAMES:
            raise UsageError(f"--frames: {spec!r} has {count} frames; at most {MAX_FRAMES} may be.")
        step = -abs(stride) if backwards else stride
        codes = [first + i * step for i in range(count)]
        frames += [float(code) for code in codes]
        decimals = max([decimals, *(-code.normalize().as_tuple().exponent for code in codes)])
    return frames, decimals


def expand_frame(name: str, frame: float | None) -> str:
    """The name with each placeholder replaced by the frame; by 0 at the default time."""
    code = math.nan if frame is None else frame
    text, needed = name.encode("utf-8"), native.ffi.new("size_t *")
    expand = native.lib().trz_frame_name
    native.check(expand(text, code, native.ffi.NULL, 0, needed))
    buffer = native.ffi.new("char[]", int(needed[0]))
    native.check(expand(text, code, buffer, len(buffer), needed))
    return native.ffi.string(buffer).decode("utf-8")


class OutputPath:
    """An output path that may hold a frame placeholder."""

    def __init__(self, path: str):
        self.path = path
        count, decimals = native.ffi.new("size_t *"), native.ffi.new("size_t *")
        native.check(native.lib().trz_frame_places(path.encode("utf-8"), count, decimals))
        if count[0] > 1:
            raise UsageError(f"{path}: more than one frame placeholder; one of them is enough.")
        self.has_placeholder = count[0] == 1
        self.decimals: int = decimals[0]
        """Decimals that the placeholder has room for."""

    def check(self, frames: list[float] | None, decimals: int) -> None:
        """Raises UsageError where `frames` (None: no range was given) would collide or not fit."""
        if frames is None:
            if self.has_placeholder:
                raise UsageError(
                    f"{self.path} has a frame placeholder, but there are no frames: add --frames."
                )
            return
        if not self.has_placeholder:
            if len(frames) > 1:
                raise UsageError(
                    f"{self.path} needs one placeholder for the frame number, such as ### or "
                    f"###.##, because --frames names {len(frames)} frames."
                )
        elif self.decimals < decimals:
            raise UsageError(
                f"{self.path}: --frames needs {decimals} decimals, so the placeholder should be "
                f"such as ###.{'#' * decimals}."
            )

    def at(self, frame: float) -> str:
        """The path of one frame."""
        return expand_frame(self.path, frame)
