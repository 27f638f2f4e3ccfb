"""Reads instances as raw arrays: point instancers as authored, and matrices of native instances.

What comes of them is the renderer's to say: it interpolates samples or moves one on by rates, joins
positions, orientations and scales, and multiplies what is nested. Here USD's values become arrays,
and ids become a mask.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .guard import FAULTS, warn_unreadable
from .log import SceneLog
from .points import Samples, moving_sample, unblocked
from .shutter import Shutter, bracketing_samples, samples_around
from .transforms import Level, compose, curve_keys
from .typed import get, get_or_ignore


@dataclass
class Instances:
    """The arrays of one instancer, as trz_instancer has them; empty ones are not there."""

    count: int = 0
    prototype_count: int = 0
    prototypes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    mask: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.uint8))
    positions: Samples = field(default_factory=Samples)
    orientations: Samples = field(default_factory=Samples)
    scales: Samples = field(default_factory=Samples)
    matrices: Samples = field(default_factory=Samples)
    velocities: Samples = field(default_factory=Samples)
    accelerations: Samples = field(default_factory=Samples)
    angular_velocities: Samples = field(default_factory=Samples)
    time_codes_per_second: float = 0.0
    varies: bool = False

    def points_nowhere(self) -> bool:
        """Whether no instance has a prototype that there is."""
        indices = self.prototypes
        return bool(self.count) and not ((indices >= 0) & (indices < self.prototype_count)).any()

    def used_prototypes(self) -> np.ndarray:
        """Numbers of the prototypes that have instances which are there, ascending."""
        indices = self.prototypes[: self.count]
        if len(self.mask) == len(indices):
            indices = indices[self.mask != 0]
        indices = indices[(indices >= 0) & (indices < self.prototype_count)]
        return np.flatnonzero(np.bincount(indices, minlength=1)) if len(indices) else indices


BY_INDEX = "its instances are known by their numbers"
"""What is done where ids cannot be used."""

# Point instancers ---------------------------------------------------------------------------------


def read_point_instancer(
    instancer: UsdGeom.PointInstancer, prototype_count: int, shutter: Shutter, log: SceneLog
) -> Instances:
    """The arrays of a PointInstancer at a frame; without instances where it has none."""
    path = instancer.GetPath()
    indices = instancer.GetProtoIndicesAttr()
    rates = {
        "velocities": instancer.GetVelocitiesAttr(),
        "accelerations": instancer.GetAccelerationsAttr(),
        "angular_velocities": instancer.GetAngularVelocitiesAttr(),
    }
    orientations = instancer.GetOrientationsfAttr()
    if not _has_values(orientations, log):
        orientations = instancer.GetOrientationsAttr()
    moved = {
        "positions": (instancer.GetPositionsAttr(), 3),
        "orientations": (orientations, 4),
        "scales": (instancer.GetScalesAttr(), 3),
    }
    chosen = (instancer.GetIdsAttr(), instancer.GetInvisibleIdsAttr(), indices)
    attributes = [*rates.values(), *(attribute for attribute, _ in moved.values()), *chosen]
    instances = Instances(
        prototype_count=prototype_count,
        varies=any(attribute.ValueMightBeTimeVarying() for attribute in attributes),
        time_codes_per_second=instancer.GetPrim().GetStage().GetTimeCodesPerSecond(),
    )
    value = get(indices, shutter.time)
    if value is not None:
        instances.prototypes = np.ascontiguousarray(value, dtype=np.int32)
        if not len(instances.prototypes):
            return instances
    needed = {
        "prototypes": prototype_count,
        "protoIndices": value is not None,
        "positions": get(instancer.GetPositionsAttr(), shutter.time) is not None,
    }
    missing = [name for name, there in needed.items() if not there]
    if missing:
        log.warn(path, "topology", f"it has no {' and no '.join(missing)}; it is not rendered")
        return instances
    count = len(instances.prototypes)
    if not len(get(instancer.GetPositionsAttr(), shutter.time)):
        log.warn(path, "topology", f"0 positions for {count} instances; they are not rendered")
        return instances
    instances.count = count
    instances.mask = _mask(instancer, instances.count, shutter, log)
    has_rates = _read_rates(instances, rates, shutter, path, log)
    still = _changes_ids(instancer, shutter, log) and not has_rates
    if still:
        text = "its instances change within the shutter and have no velocities: they do not move"
        log.warn(path, "time-samples", text)
    for name, (attribute, width) in moved.items():
        try:
            samples = _samples(attribute, width, shutter, has_rates, still)
        except FAULTS as error:
            warn_unreadable(log, path, error, f"its {name} are ignored")
            continue
        setattr(instances, name, samples)
    return instances


def _samples(
    attribute: Usd.Attribute, width: int, shutter: Shutter, has_rates: bool, still: bool
) -> Samples:
    """Samples around the shutter, and around the frame where rates may move one of them."""
    times = samples_around(attribute, shutter) if has_rates else None
    if not times and not still:
        times = bracketing_samples(attribute, shutter)
    if times:
        samples = unblocked(attribute, times, shutter)
        arrays = [_floats(value, width) for value in samples.values()]
        return Samples([time - shutter.frame for time in samples], arrays)
    time = shutter.time if still else shutter.code(shutter.open)
    array = _floats(get(attribute, time), width)
    return Samples([shutter.open], [array]) if len(array) else Samples()


def _read_rates(instances: Instances, rates: dict, shutter: Shutter, path, log: SceneLog) -> bool:
    """Reads velocities and the like; True where there are any that may count."""
    found = False
    for name, attribute in rates.items():
        if not attribute.HasAuthoredValue():
            continue
        if get_or_ignore(attribute, shutter.time, log) is None:
            continue
        times = samples_around(attribute, shutter)
        if not times:
            if shutter.moves:
                text = f"its {attribute.GetName()} are ignored: they have no time samples"
                log.warn(path, "velocities", text)
            continue
        # Only the sample at or before the frame has values, for no other is used.
        arrays = [_floats(None, 3)] * len(times)
        base = moving_sample(times, shutter)
        arrays[base] = _floats(get_or_ignore(attribute, Usd.TimeCode(times[base]), log), 3)
        setattr(instances, name, Samples([time - shutter.frame for time in times], arrays))
        found = found or (name != "accelerations" and arrays[base].size > 0)
    return found


def _mask(
    instancer: UsdGeom.PointInstancer, count: int, shutter: Shutter, log: SceneLog
) -> np.ndarray:
    """1 for instances whose ids are neither invisible nor inactive; empty where all are there."""
    inactive = instancer.GetPrim().GetMetadata("inactiveIds")
    invisible = get_or_ignore(instancer.GetInvisibleIdsAttr(), shutter.time, log)
    ids = get_or_ignore(instancer.GetIdsAttr(), shutter.time, log, outcome=BY_INDEX)
    masked = [list(inactive.explicitItems) if inactive else []]
    masked.append([] if invisible is None else invisible)
    masked = np.concatenate([np.asarray(ids, dtype=np.int64) for ids in masked])
    if not len(masked):
        return np.zeros(0, dtype=np.uint8)
    if ids is not None and len(ids) != count:
        text = f"{len(ids)} ids for {count} instances; {BY_INDEX}"
        log.warn(instancer.GetPath(), "topology", text)
        ids = None
    ids = np.arange(count) if ids is None else np.asarray(ids, dtype=np.int64)
    mask = ~np.isin(ids, masked)
    return np.zeros(0, dtype=np.uint8) if mask.all() else mask.astype(np.uint8)


def _changes_ids(instancer: UsdGeom.PointInstancer, shutter: Shutter, log: SceneLog) -> bool:
    """Whether samples within the shutter are of other instances than the frame's."""
    ids = instancer.GetIdsAttr()
    times = bracketing_samples(instancer.GetPositionsAttr(), shutter)
    if not times or not ids.ValueMightBeTimeVarying():
        return False
    frame = get_or_ignore(ids, shutter.time, log, outcome=BY_INDEX)
    if frame is None:
        return False
    return any(ids.Get(Usd.TimeCode(time)) != frame for time in times)


def _has_values(attribute: Usd.Attribute, log: SceneLog) -> bool:
    """Whether it has any by default, or in its first sample: USD's rule for orientationsf."""
    times = [Usd.TimeCode.Default(), *map(Usd.TimeCode, attribute.GetTimeSamples()[:1])]
    return any(get_or_ignore(attribute, time, log) for time in times)


def _floats(value, width: int) -> np.ndarray:
    if value is None:
        return np.zeros((0, width), dtype=np.float32)
    return np.ascontiguousarray(value, dtype=np.float32).reshape(-1, width)


# Native instances ---------------------------------------------------------------------------------


def native_instances(
    levels: dict[int, list[Level]], count: int, prototypes: np.ndarray, shutter: Shutter
) -> Instances:
    """Instances with a matrix each: what `levels` by number multiply to; other numbers are masked.

    All get the same keys: those of the levels that move, and more where a product bends.
    """
    numbers = np.fromiter(levels, dtype=np.int64, count=len(levels))
    still = np.zeros((count, 4, 4))
    still[:] = np.eye(4)
    moving = {}
    for number, own in levels.items():
        if all(level.static for level in own):
            still[number] = compose(own, 0.0)
        else:
            moving[number] = own

    def evaluate(time):
        matrices = still.copy() if moving else still
        for number, own in moving.items():
            matrices[number] = compose(own, time)
        return matrices

    times = {float(t) for own in moving.values() for level in own for t in level.times}
    if times:
        times |= {shutter.open, shutter.close}
        times, matrices = curve_keys(sorted(times), evaluate)
    else:
        times, matrices = [shutter.open], still[None]
    mask = np.zeros(count, dtype=np.uint8)
    mask[numbers] = 1
    return Instances(
        count=count,
        prototypes=prototypes,
        mask=np.zeros(0, dtype=np.uint8) if mask.all() else mask,
        matrices=Samples(list(times), list(matrices)),
        varies=True,
    )
