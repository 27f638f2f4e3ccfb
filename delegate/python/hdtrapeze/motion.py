"""How the motion of prims is blurred: UsdGeomMotionAPI, whose values are inherited down namespace.

The renderer scales a prim's blur by multiplying times relative to the frame. So where the scale is
not 1, whatever moves the prim is read around another shutter, the scaled one.
"""

import math
from dataclasses import dataclass

from pxr import Usd, UsdGeom

from .log import SceneLog
from .shutter import Shutter
from .transforms import TransformReader
from .typed import get_or_ignore


@dataclass(frozen=True)
class Motion:
    """Blur of one prim."""

    blur_scale: float = 1.0
    """As authored."""
    nonlinear_samples: int = 0
    """Positions over the shutter where accelerations bend a path; 0 where none are authored."""


@dataclass(frozen=True)
class Timing:
    """What the motion of a prim is read with."""

    shutter: Shutter
    transforms: TransformReader


class MotionReader:
    """Reads the motion of prims for one frame, each prim once."""

    def __init__(self, shutter: Shutter, transforms: TransformReader, log: SceneLog):
        self._shutter = shutter
        self._log = log
        self._known: dict = {}
        self._timings = {1.0: Timing(shutter, transforms)}

    def of(self, prim: Usd.Prim) -> Motion:
        """The prim's own motion, where it has some, over that of its parents."""
        waiting = []
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self._known:
            waiting.append(prim)
            prim = prim.GetParent()
        motion = self._known.get(prim.GetPath(), Motion()) if prim else Motion()
        for below in reversed(waiting):
            if below.HasAPI(UsdGeom.MotionAPI):
                motion = self._read(below, motion)
            self._known[below.GetPath()] = motion
        return motion

    def _read(self, prim: Usd.Prim, inherited: Motion) -> Motion:
        api = UsdGeom.MotionAPI(prim)
        scale = self._authored(api.GetMotionBlurScaleAttr())
        samples = self._authored(api.GetNonlinearSampleCountAttr())
        if samples is not None and samples < 1:
            text = f"motion:nonlinearSampleCount is {samples}; as many as needed are taken"
            self._log.warn(prim.GetPath(), "motion", text)
            samples = 0
        return Motion(
            inherited.blur_scale if scale is None else float(scale),
            inherited.nonlinear_samples if samples is None else samples,
        )

    def _authored(self, attribute: Usd.Attribute):
        if not attribute.HasAuthoredValue():
            return None
        return get_or_ignore(attribute, self._shutter.time, self._log)

    def timing(self, motion: Motion) -> Timing:
        """Shutter and transforms that cover what is seen of prims with this motion."""
        scale = motion.blur_scale
        if not (math.isfinite(scale) and scale >= 0.0):
            scale = 1.0  # the renderer warns
        if scale not in self._timings:
            shutter = self._shutter.scaled(scale)
            self._timings[scale] = Timing(shutter, TransformReader(shutter, self._log))
        return self._timings[scale]
