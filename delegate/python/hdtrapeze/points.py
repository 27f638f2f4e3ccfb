"""Reads the points of any UsdGeomPointBased as raw samples, with velocities and accelerations.

What comes of them is the renderer's to say: it joins samples by lines, or moves one of them on.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .shutter import Shutter, between_blocks, bracketing_samples, samples_around
from .typed import get, get_or_ignore
from .varying import changes_count, changes_topology, points_at_frame, warn_still


@dataclass
class Samples:
    """Arrays at times relative to the frame."""

    times: list[float] = field(default_factory=list)
    arrays: list[np.ndarray] = field(default_factory=list)  # (n, 3) f32 each


@dataclass
class Points:
    """Object-space points at times relative to the frame, and what moves them on."""

    times: list[float]
    arrays: list[np.ndarray]  # (n, 3) f32 each
    varies: bool = False
    velocities: Samples = field(default_factory=Samples)
    accelerations: Samples = field(default_factory=Samples)
    time_codes_per_second: float = 0.0


def read_points(
    mesh: UsdGeom.PointBased, shutter: Shutter, topology_varies: bool, log: SceneLog
) -> Points:
    """Points as authored around the shutter; with velocities, around the frame as well.

    Where the topology changes, the points are those of the frame; where no velocities move them,
    there is a warning.
    """
    moved = _with_velocities(mesh, shutter, topology_varies, log)
    if moved:
        return moved
    attribute = mesh.GetPointsAttr()
    varies = attribute.ValueMightBeTimeVarying()
    times = bracketing_samples(attribute, shutter)
    if times:
        samples = unblocked(attribute, times, shutter)
        changes = changes_topology if topology_varies else changes_count
        if samples and not changes(mesh.GetPrim(), samples, shutter):
            arrays = [_array(value) for value in samples.values()]
            return Points([time - shutter.frame for time in samples], arrays, True)
    if times or topology_varies:
        points = _array(points_at_frame(mesh.GetPrim(), shutter))
        if times:
            warn_still(mesh.GetPrim(), points, not topology_varies, log)
        return Points([shutter.open], [points], varies)
    return Points([shutter.open], [_array(get(attribute, shutter.code(shutter.open)))], varies)


def _with_velocities(
    mesh: UsdGeom.PointBased, shutter: Shutter, topology_varies: bool, log: SceneLog
) -> Points | None:
    """Samples of points and rates; None where there are no velocities that could move them."""
    prim, attribute, velocities = mesh.GetPrim(), mesh.GetPointsAttr(), mesh.GetVelocitiesAttr()
    if shutter.frame is None or not velocities.HasAuthoredValue():
        return None
    if get_or_ignore(velocities, shutter.time, log) is None:
        return None
    speeds = _rates(velocities, shutter, log)
    bends = _rates(mesh.GetAccelerationsAttr(), shutter, log)
    times = samples_around(attribute, shutter)
    if not times or not speeds.times:
        if shutter.moves:
            text = "its velocities are ignored: points or velocities have no time samples"
            log.warn(prim.GetPath(), "velocities", text)
        return None
    if not any(array.size for array in speeds.arrays):
        return None
    base = moving_sample(times, shutter)
    held = prim.GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld
    samples = unblocked(attribute, times, shutter)
    changes = changes_topology if topology_varies else changes_count
    if held or len(samples) < len(times) or changes(prim, samples, shutter):
        # Where velocities do not move it, the sample must not be joined with another.
        arrays = [_array(get(attribute, Usd.TimeCode(times[base])))] * len(times)
    else:
        arrays = [_array(value) for value in samples.values()]
    per_second = prim.GetStage().GetTimeCodesPerSecond()
    relative = [time - shutter.frame for time in times]
    return Points(relative, arrays, True, speeds, bends, per_second)


def unblocked(attribute: Usd.Attribute, times: list[float], shutter: Shutter) -> dict:
    """Values by time, of those of `times` that no block is between them and the frame."""
    samples = {time: get(attribute, Usd.TimeCode(time)) for time in times}
    known = [time - shutter.frame for time, value in samples.items() if value is not None]
    blocks = [time - shutter.frame for time, value in samples.items() if value is None]
    kept = between_blocks(known, blocks)
    return {time: value for time, value in samples.items() if time - shutter.frame in kept}


def _rates(attribute: Usd.Attribute, shutter: Shutter, log: SceneLog) -> Samples:
    """Samples around the frame; only the one at or before it has values, for no other is used."""
    times = samples_around(attribute, shutter)
    arrays = [_array(None)] * len(times)
    if times:
        base = moving_sample(times, shutter)
        arrays[base] = _array(get_or_ignore(attribute, Usd.TimeCode(times[base]), log))
    return Samples([time - shutter.frame for time in times], arrays)


def moving_sample(times: list[float], shutter: Shutter) -> int:
    """Number of the last of `times` at or before the frame, or of the first."""
    return max((i for i, time in enumerate(times) if time <= shutter.frame), default=0)


def _array(value) -> np.ndarray:
    if value is None:
        return np.zeros((0, 3), dtype=np.float32)
    return np.ascontiguousarray(value, dtype=np.float32).reshape(-1, 3)
