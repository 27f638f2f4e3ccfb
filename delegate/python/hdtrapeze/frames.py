"""Frame ranges and frame numbers in file names, as usdrecord writes them.

A frame specification is `start[:end[xstride]]`, several of them joined by commas. The output path
then holds one placeholder: hashes, with a dot and more hashes for fractions (`###`, `###.##`).
"""

import re

from pxr import Tf, UsdUtils

from .errors import UsageError

_PLACEHOLDER = re.compile(r"#+(?:\.#+)?")


def parse_frames(specs: str) -> tuple[list[float], int]:
    """Frames of `specs` in order, and the number of decimals that tell them apart."""
    frames: list[float] = []
    decimals = 0
    for spec in specs.split(","):
        spec = spec.strip()
        try:
            time_codes = UsdUtils.TimeCodeRange.CreateFromFrameSpec(spec)
        except Tf.ErrorException:
            raise UsageError(
                f"--frames: {spec!r} is not a frame range. Valid are 12, 1:10, 10:1, 1:10x2 and "
                f"1:2x0.5, or several joined by commas."
            ) from None
        frames.extend(code.GetValue() for code in time_codes)
        numbers = re.split("[:x]", spec)
        decimals = max([decimals] + [len(n.partition(".")[2].rstrip("0")) for n in numbers])
    return frames, decimals


class OutputPath:
    """An output path that may hold a frame placeholder."""

    def __init__(self, path: str):
        self.path = path
        found = _PLACEHOLDER.findall(path)
        if len(found) > 1:
            raise UsageError(f"{path}: more than one frame placeholder; one of them is enough.")
        self.placeholder = found[0] if found else None

    @property
    def decimals(self) -> int:
        """Decimals that the placeholder has room for."""
        return len((self.placeholder or "").partition(".")[2])

    def check(self, frames: list[float] | None, decimals: int) -> None:
        """Raises UsageError where `frames` (None: no range was given) would collide or not fit."""
        if frames is None:
            if self.placeholder:
                raise UsageError(
                    f"{self.path} has a frame placeholder, but there are no frames: add --frames."
                )
            return
        if not self.placeholder:
            if len(frames) > 1:
                raise UsageError(
                    f"{self.path} needs one placeholder for the frame number, such as ### or "
                    f"###.##, because --frames names {len(frames)} frames."
                )
        elif self.decimals < decimals:
            raise UsageError(
                f"{self.path}: --frames needs {decimals} decimals, so the placeholder should be "
                f"{self.placeholder.partition('.')[0]}.{'#' * decimals}."
            )

    def at(self, frame: float) -> str:
        """The path of one frame."""
        if not self.placeholder:
            return self.path
        number = f"{frame:0{len(self.placeholder)}.{self.decimals}f}"
        return self.path.replace(self.placeholder, number)
