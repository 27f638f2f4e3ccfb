"""How the motion of prims is blurred: UsdGeomMotionAPI, whose values are inherited down namespace.

The renderer scales a prim's blur by multiplying times relative to the frame. So where the scale is
not 1, whatever moves the prim is read around another shutter, the scaled one.
"""

import math
from dataclasses import dataclass

from pxr import Usd, UsdGeom

from .guard import FAULTS, number, warn_unreadable
from .log import SceneLog
from .shutter import Shutter
from .transforms import TransformReader


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
        if not prim or prim.IsPseudoRoot():
            return Motion()
        path = prim.GetPath()
        if path not in self._known:
            inherited = self.of(prim.GetParent())
            has_own = prim.HasAPI(UsdGeom.MotionAPI)
            self._known[path] = self._read(prim, inherited) if has_own else inherited
        return self._known[path]

    def _read(self, prim: Usd.Prim, inherited: Motion) -> Motion:
        api = UsdGeom.MotionAPI(prim)
        scale, samples = inherited.blur_scale, inherited.nonlinear_samples
        time = self._shutter.time
        try:
            if api.GetMotionBlurScaleAttr().HasAuthoredValue():
                scale = number(api.GetMotionBlurScaleAttr(), time)
            if api.GetNonlinearSampleCountAttr().HasAuthoredValue():
                samples = int(number(api.GetNonlinearSampleCountAttr(), time))
                if samples < 1:
                    text = f"motion:nonlinearSampleCount is {samples}; as many as needed are taken"
                    self._log.warn(prim.GetPath(), "motion", text)
                    samples = 0
        except FAULTS as error:
            warn_unreadable(self._log, prim.GetPath(), error, "it is ignored")
        return Motion(scale, samples)

    def timing(self, motion: Motion) -> Timing:
        """Shutter and transforms that cover what is seen of prims with this motion."""
        scale = motion.blur_scale
        if not (math.isfinite(scale) and scale >= 0.0):
            scale = 1.0  # the renderer warns
        if scale not in self._timings:
            shutter = self._shutter.scaled(scale)
            self._timings[scale] = Timing(shutter, TransformReader(shutter, self._log))
        return self._timings[scale]
