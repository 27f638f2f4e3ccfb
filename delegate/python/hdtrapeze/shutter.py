"""The shutter of one frame, and authored times within it.

Times given to USD are time codes; times given to the renderer are relative to the frame. At the
default time (no frame) nothing moves.
"""

import bisect
import math
from dataclasses import dataclass

from pxr import Usd


@dataclass(frozen=True)
class Shutter:
    """Frame (None: the default time), and shutter in time codes relative to it."""

    frame: float | None
    open: float = 0.0
    close: float = 0.0

    @property
    def time(self) -> Usd.TimeCode:
        """The frame as a USD time, for everything that has one value a frame."""
        return Usd.TimeCode.Default() if self.frame is None else Usd.TimeCode(self.frame)

    @property
    def moves(self) -> bool:
        """Whether there is a time span at all."""
        return self.frame is not None and self.close > self.open

    def scaled(self, scale: float) -> "Shutter":
        """The same frame, with open and close `scale` times as far from it."""
        return Shutter(self.frame, self.open * scale, self.close * scale)

    def code(self, time: float) -> Usd.TimeCode:
        """The USD time of a relative time."""
        return Usd.TimeCode.Default() if self.frame is None else Usd.TimeCode(self.frame + time)

    def keys(self, samples: list[float]) -> list[float]:
        """Relative times of open, close and the authored samples between them.

        `samples` are the ascending times of an attribute. Where the value cannot change within
        the shutter there is one key.
        """
        if not self.moves or len(samples) < 2:
            return [self.open]
        start, end = self.frame + self.open, self.frame + self.close
        if end <= samples[0] or start >= samples[-1]:
            return [self.open]
        first, last = bisect.bisect_right(samples, start), bisect.bisect_left(samples, end)
        return [self.open, *(t - self.frame for t in samples[first:last]), self.close]


def bracketing_samples(attribute: Usd.Attribute, shutter: Shutter) -> list[float] | None:
    """Authored times within the shutter and the nearest one at either side of it.

    None where the attribute has one value over the shutter, or steps from value to value.
    """
    if not shutter.moves or not attribute.ValueMightBeTimeVarying():
        return None
    if attribute.GetPrim().GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld:
        return None
    start, end = shutter.frame + shutter.open, shutter.frame + shutter.close
    first = attribute.GetBracketingTimeSamples(start)
    last = attribute.GetBracketingTimeSamples(end)
    if not first or not last:
        return None
    samples = attribute.GetTimeSamples()
    low = bisect.bisect_left(samples, first[0])
    high = bisect.bisect_right(samples, last[1])
    found = samples[low:high]
    return found if len(found) > 1 else None


def between_blocks(times: list[float], blocks: list[float]) -> list[float]:
    """Those of `times` with no block between them and the frame, which is at 0; none where the
    frame is blocked.

    USD holds the sample before a block up to it, and has no value from there to the next sample.
    `blocks` are times of samples without a value; `times` of those with one.
    """
    start = max((time for time in blocks if time <= 0.0), default=-math.inf)
    end = min((time for time in blocks if time > 0.0), default=math.inf)
    kept = [time for time in times if start < time < end]
    is_blocked = math.isfinite(start) and not any(time <= 0.0 for time in kept)
    return [] if is_blocked else kept


def samples_around(attribute: Usd.Attribute, shutter: Shutter) -> list[float]:
    """Authored times around the frame and the shutter; none where there is no time sample.

    From the last at or before both (or the first) to the first after both (or the last).
    """
    if shutter.frame is None:
        return []
    samples = attribute.GetTimeSamples()
    start = shutter.frame + min(shutter.open, 0.0)
    end = shutter.frame + max(shutter.close, 0.0)
    first = max(bisect.bisect_right(samples, start) - 1, 0)
    return samples[first : bisect.bisect_right(samples, end) + 1]
