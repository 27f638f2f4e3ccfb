"""A camera's lens over the shutter, its aperture and its shutter curve.

UsdGeomCamera says nothing of blades and of how a shutter opens. Both are read from attributes of
the camera prim: the renderer's own, else RenderMan's (ri:), else Arnold's (primvars:arnold:):

| trapeze: | ri: | primvars:arnold: |
|---|---|---|
| int aperture:blades | apertureNSides | aperture_blades |
| float aperture:rotation, degrees | apertureAngle | aperture_rotation |
| float aperture:roundness, 0 to 1 | apertureRoundness | aperture_blade_curvature |
| float aperture:ratio, width over height | | |
| float2[] shutter:curve | shutterOpenTime, shutterCloseTime, shutteropening | shutter_curve |

Each by itself, but that RenderMan's blades are round where no roundness is authored, and that
Arnold's curve counts where its shutter_type says so.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from numbers import Real

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .guard import mistyped
from .log import SceneLog
from .shutter import Shutter, bracketing_samples
from .typed import get_or_fallback, get_or_ignore, up_to_block, warn_unknown

APERTURE_UNIT = 0.1
"""Scene units of one unit of aperture or focal length."""

EXPOSURE_ERROR = 0.004
"""Relative: exposure is a power of 2, and straight pieces between keys leave it by less."""
EXPOSURE_HALVINGS = 8
"""The shutter has at most 2 to the power of this many such pieces between two samples."""

LENS_ATTRIBUTES = {
    "horizontal_aperture": ("horizontalAperture", APERTURE_UNIT),
    "vertical_aperture": ("verticalAperture", APERTURE_UNIT),
    "horizontal_aperture_offset": ("horizontalApertureOffset", APERTURE_UNIT),
    "vertical_aperture_offset": ("verticalApertureOffset", APERTURE_UNIT),
    "focal_length": ("focalLength", APERTURE_UNIT),
    "focus_distance": ("focusDistance", 1.0),
    "f_stop": ("fStop", 1.0),
}
"""Fields of the renderer's lens samples: attribute, and scene units of one of its units."""

EXPOSURE_ATTRIBUTES = (
    "exposure",
    "exposure:iso",
    "exposure:time",
    "exposure:fStop",
    "exposure:responsivity",
)


@dataclass
class Aperture:
    """The shape of the lens' opening; the defaults are a round one."""

    blades: int = 0
    rotation: float = 0.0
    ratio: float = 1.0
    roundness: float = 0.0


@dataclass
class ShutterCurve:
    """Position and openness of points, and how they are joined; none: open throughout."""

    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    bezier: bool = False


def read_lens(
    camera: UsdGeom.Camera, time: Usd.TimeCode, frame: Usd.TimeCode, log: SceneLog
) -> dict[str, float]:
    """Lens, film back and exposure at one time around a frame, in scene units; by the names of the
    C ABI."""
    prim = camera.GetPrim()
    lens = {
        name: float(get_or_fallback(prim.GetAttribute(attribute), time, log, frame)) * factor
        for name, (attribute, factor) in LENS_ATTRIBUTES.items()
    }
    lens["f_stop"] = _f_stop(camera, time, lens["f_stop"])
    lens["exposure_scale"] = _exposure_scale(camera, time, frame, log)
    return lens


def _f_stop(camera: UsdGeom.Camera, time: Usd.TimeCode, value: float) -> float:
    """fStop between a sample with a pinhole, 0, and one with a lens: the radius goes linearly.

    fStop itself would pass near 0 on its way, where a lens is without bounds.
    """
    attribute = camera.GetFStopAttr()
    if time.IsDefault() or not attribute.ValueMightBeTimeVarying():
        return value
    if camera.GetPrim().GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld:
        return value
    around = attribute.GetBracketingTimeSamples(time.GetValue())
    if len(around) != 2 or around[0] == around[1]:
        return value
    ends = [attribute.Get(Usd.TimeCode(sample)) for sample in around]
    if not all(isinstance(end, Real) for end in ends):
        return value  # blocked, or of another type
    first, second = map(float, ends)
    if (first == 0.0) == (second == 0.0):
        return value
    part = (time.GetValue() - around[0]) / (around[1] - around[0])
    lens, open_part = (second, part) if first == 0.0 else (first, 1.0 - part)
    return lens / open_part if open_part > 0.0 else 0.0


def _exposure_scale(
    camera: UsdGeom.Camera, time: Usd.TimeCode, frame: Usd.TimeCode, log: SceneLog
) -> float:
    wrong = mistyped(camera.GetPrim(), EXPOSURE_ATTRIBUTES)
    if wrong:
        log.warn(camera.GetPath(), "type", f"{wrong}; its exposure is taken as 1")
        return 1.0
    for name in EXPOSURE_ATTRIBUTES:
        time = up_to_block(camera.GetPrim().GetAttribute(name), time, frame)
        get_or_fallback(camera.GetPrim().GetAttribute(name), time, log)  # which USD takes as well
    return float(camera.ComputeLinearExposureScale(time))


def read_lens_samples(
    camera: UsdGeom.Camera, shutter: Shutter, log: SceneLog
) -> list[tuple[float, dict[str, float]]]:
    """Times relative to the frame and lenses at all samples that matter for the shutter.

    Empty where the lens does not change while the shutter is open.
    """
    names = [attribute for attribute, _ in LENS_ATTRIBUTES.values()]
    times = _sample_times(camera, names, shutter)
    exposure_times = _sample_times(camera, EXPOSURE_ATTRIBUTES, shutter)
    if exposure_times:
        opens, closes = shutter.frame + shutter.open, shutter.frame + shutter.close
        ends = sorted({min(max(t, opens), closes) for t in times | exposure_times})
        times.update(ends)
        for start, end in pairwise(ends):
            times.update(_exposure_keys(camera, start, end, shutter.time, log))
    return [
        (time - shutter.frame, read_lens(camera, Usd.TimeCode(time), shutter.time, log))
        for time in sorted(times)
    ]


def _exposure_keys(
    camera: UsdGeom.Camera, start: float, end: float, frame: Usd.TimeCode, log: SceneLog
) -> list[float]:
    """Times between which the exposure's scale is straight."""

    def scale(time: float) -> float:
        return _exposure_scale(camera, Usd.TimeCode(time), frame, log)

    found = []
    pending = [(start, scale(start), end, scale(end), EXPOSURE_HALVINGS)]
    while pending:
        low, at_low, high, at_high, halvings = pending.pop()
        middle = (low + high) / 2.0
        at_middle = scale(middle)
        off = abs((at_low + at_high) / 2.0 - at_middle)
        if halvings and math.isfinite(off) and off > EXPOSURE_ERROR * at_middle:
            found.append(middle)
            pending.append((low, at_low, middle, at_middle, halvings - 1))
            pending.append((middle, at_middle, high, at_high, halvings - 1))
    return found


def _sample_times(camera: UsdGeom.Camera, names, shutter: Shutter) -> set[float]:
    """Authored times around and within the shutter, of all attributes together."""
    times = set()
    for name in names:
        attribute = camera.GetPrim().GetAttribute(name)
        if attribute:
            times.update(bracketing_samples(attribute, shutter) or ())
    return times


KNOWN = (
    "aperture:blades",
    "aperture:rotation",
    "aperture:roundness",
    "aperture:ratio",
    "shutter:curve",
)
"""Attributes of a camera in the namespace `trapeze`."""


class _Attributes:
    """Custom attributes of a camera: what is authored, or a default with a warning."""

    def __init__(self, camera: UsdGeom.Camera, time: Usd.TimeCode, log: SceneLog):
        self._prim, self._time, self._log = camera.GetPrim(), time, log

    def first(self, *names: str) -> Usd.Attribute | None:
        """The first attribute of these names that has a value."""
        found = (self._prim.GetAttribute(name) for name in names)
        return next((a for a in found if a and a.HasAuthoredValue()), None)

    def number(self, default: float, *names: str) -> float:
        """The number of the first of these attributes that is authored."""
        attribute = self.first(*names)
        if attribute is None:
            return default
        outcome = f"{default:g} is used"
        value = self.value(attribute, Sdf.ValueTypeNames.Double, outcome)
        return default if value is None else float(value)

    def value(self, attribute: Usd.Attribute, expected: Sdf.ValueTypeName, outcome: str):
        """The attribute's value; None where it is of another type than `expected`."""
        return get_or_ignore(attribute, self._time, self._log, expected, outcome)

    def pairs(self, attribute: Usd.Attribute) -> np.ndarray | None:
        """The attribute's pairs of numbers, (n, 2); None with a warning where it has none."""
        expected = Sdf.ValueTypeNames.Float2Array
        value = self.value(attribute, expected, "the shutter is open throughout")
        return None if value is None else np.array(value, dtype=np.float64).reshape(-1, 2)

    def warn(self, text: str) -> None:
        self._log.warn(self._prim.GetPath(), "type", text)


def read_aperture(camera: UsdGeom.Camera, time: Usd.TimeCode, log: SceneLog) -> Aperture:
    """The shape of the lens' opening; the renderer checks the numbers."""
    read = _Attributes(camera, time, log)
    warn_unknown(camera.GetPrim(), KNOWN, "attribute of a camera", log)
    names = ("trapeze:aperture:blades", "ri:apertureNSides", "primvars:arnold:aperture_blades")
    blades = read.number(0, *names)
    if not (math.isfinite(blades) and blades == int(blades) and 0 <= blades < 1 << 31):
        read.warn(f"an aperture of {blades:g} blades cannot be; it is round")
        blades = 0
    source = read.first(*names)
    is_rendermans = source is not None and source.GetName() == names[1]
    return Aperture(
        blades=int(blades),
        rotation=read.number(
            0.0,
            "trapeze:aperture:rotation",
            "ri:apertureAngle",
            "primvars:arnold:aperture_rotation",
        ),
        ratio=read.number(1.0, "trapeze:aperture:ratio"),
        roundness=read.number(
            1.0 if is_rendermans else 0.0,
            "trapeze:aperture:roundness",
            "ri:apertureRoundness",
            "primvars:arnold:aperture_blade_curvature",
        ),
    )


def read_shutter_curve(camera: UsdGeom.Camera, time: Usd.TimeCode, log: SceneLog) -> ShutterCurve:
    """How the shutter opens and closes; the renderer checks the numbers."""
    read = _Attributes(camera, time, log)
    if own := read.first("trapeze:shutter:curve"):
        pairs = read.pairs(own)
        return ShutterCurve() if pairs is None else ShutterCurve(pairs)
    if read.first("ri:shutterOpenTime", "ri:shutterCloseTime", "ri:shutteropening"):
        return _rendermans_curve(read)
    if attribute := read.first("primvars:arnold:shutter_type"):
        kind = attribute.Get(time)
        if kind == "triangle":
            return ShutterCurve(np.array([(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)]))
        curve = read.first("primvars:arnold:shutter_curve")
        if kind == "curve" and curve is not None:
            pairs = read.pairs(curve)
            return ShutterCurve() if pairs is None else ShutterCurve(pairs)
    return ShutterCurve()


def _rendermans_curve(read: _Attributes) -> ShutterCurve:
    """Fully open from shutterOpenTime to shutterCloseTime; the ramps before and after are straight,
    or Bezier segments whose inner control points are shutteropening."""
    opened = read.number(0.0, "ri:shutterOpenTime")
    closes = read.number(1.0, "ri:shutterCloseTime")
    straight = np.array([(0.0, 0.0), (opened, 1.0), (closes, 1.0), (1.0, 0.0)])
    attribute = read.first("ri:shutteropening")
    if attribute is None:
        return ShutterCurve(straight)
    value = read.value(attribute, Sdf.ValueTypeNames.FloatArray, "straight ramps are used")
    if value is None:
        return ShutterCurve(straight)
    if len(value) != 8:
        read.warn("ri:shutteropening is not 8 numbers; straight ramps are used")
        return ShutterCurve(straight)
    controls = np.array(value, dtype=np.float64).reshape(4, 2)
    middle = [(opened + (closes - opened) * f, 1.0) for f in (0.0, 1 / 3, 2 / 3, 1.0)]
    points = [(0.0, 0.0), *controls[:2], *middle, *controls[2:], (1.0, 0.0)]
    return ShutterCurve(np.array(points), bezier=True)
