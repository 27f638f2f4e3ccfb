"""Points whose number or order changes in time: which of their samples belong together.

Topology has no values between its samples: it holds from each to the next. So points of one sample
may only be joined with those of another where both have the same topology.
"""

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .shutter import Shutter
from .typed import get

_TOPOLOGY = (
    "faceVertexCounts",
    "faceVertexIndices",
    "curveVertexCounts",
    "uVertexCount",
    "vVertexCount",
    "ids",
)


def changes_count(prim: Usd.Prim, samples: dict, shutter: Shutter) -> bool:
    """Whether one of the points' `samples`, values by time, has another number than the frame's."""
    points = UsdGeom.PointBased(prim).GetPointsAttr()
    held = _before(points, shutter.frame)
    frames = samples[held] if held in samples else _at_frame(points, shutter)
    return any(len(value) != len(frames) for value in samples.values())


def changes_topology(prim: Usd.Prim, samples: dict, shutter: Shutter) -> bool:
    """Whether points or topology at any of `samples` do not belong to those of the frame."""
    if changes_count(prim, samples, shutter):
        return True
    for name in _TOPOLOGY:
        attribute = prim.GetAttribute(name)
        if attribute and attribute.ValueMightBeTimeVarying():
            held = _before(attribute, shutter.frame)
            others = {_before(attribute, time) for time in samples} - {held}
            frames = attribute.Get(shutter.time)
            if any(attribute.Get(time) != frames for time in others):
                return True
    return False


def points_at_frame(prim: Usd.Prim, shutter: Shutter) -> np.ndarray | None:
    """Points that belong to the topology of the frame; None where there are none."""
    points = UsdGeom.PointBased(prim).GetPointsAttr()
    if shutter.frame is None:
        return get(points, shutter.time)
    around = points.GetBracketingTimeSamples(shutter.frame)
    values = {time: get(points, time) or () for time in around}
    if len(around) == 2 and changes_topology(prim, values, shutter):
        return _at_frame(points, shutter)
    return get(points, shutter.time)


def warn_still(prim: Usd.Prim, points: np.ndarray, only_count: bool, log: SceneLog) -> None:
    """That there is no blur; not where too few points for anything to be rendered say it all.

    `only_count` says that no more than the number of points changes.
    """
    indices = prim.GetAttribute("faceVertexIndices")
    used = indices and get(indices, Usd.TimeCode.EarliestTime())
    if not len(points) or (only_count and used and max(used) >= len(points)):
        return
    what = "number of points" if only_count else "topology"
    text = (
        f"its {what} changes within the shutter and it has no velocities that fit: "
        "its points do not move"
    )
    log.warn(prim.GetPath(), "varying-topology", text)


def _before(attribute: Usd.Attribute, time: float) -> float:
    """The sample that holds at `time`."""
    around = attribute.GetBracketingTimeSamples(time)
    return around[0] if around else time


def _at_frame(points: Usd.Attribute, shutter: Shutter):
    """The sample at or before the frame: it came with the topology that holds."""
    return get(points, _before(points, shutter.frame)) or ()
