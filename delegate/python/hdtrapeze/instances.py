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
from .points import Samples, moving_sample
from .shutter import Shutter, bracketing_samples, samples_around
from .transforms import Level, compose, curve_keys


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
    if not _has_values(orientations):
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
    value = indices.Get(shutter.time)
    if value is not None:
        instances.prototypes = _integers(value, np.int32)
        if not len(instances.prototypes):
            return instances
    needed = {
        "prototypes": prototype_count,
        "protoIndices": value is not None,
        "positions": instancer.GetPositionsAttr().Get(shutter.time) is not None,
    }
    missing = [name for name, there in needed.items() if not there]
    if missing:
        log.warn(path, "topology", f"it has no {' and no '.join(missing)}; it is not rendered")
        return instances
    _warn_of_primvars(instancer, log)
    instances.count = len(instances.prototypes)
    instances.mask = _mask(instancer, instances.count, shutter)
    has_rates = _read_rates(instances, rates, shutter, path, log)
    still = _changes_ids(instancer, shutter) and not has_rates
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


def _warn_of_primvars(instancer: UsdGeom.PointInstancer, log: SceneLog) -> None:
    """Prototypes inherit constant primvars; a value for each instance is not passed on."""
    api = UsdGeom.PrimvarsAPI(instancer)
    for name in ("displayColor", "displayOpacity"):
        primvar = api.GetPrimvar(name)
        if primvar and primvar.HasAuthoredValue() and primvar.GetInterpolation() != "constant":
            text = f"{name} with a value for each instance is not supported yet; it is ignored"
            log.warn(instancer.GetPath(), f"primvar-{name}", text)


def _samples(
    attribute: Usd.Attribute, width: int, shutter: Shutter, has_rates: bool, still: bool
) -> Samples:
    """Samples around the shutter, and around the frame where rates may move one of them."""
    times = samples_around(attribute, shutter) if has_rates else None
    if not times and not still:
        times = bracketing_samples(attribute, shutter)
    if times:
        arrays = [_floats(attribute.Get(Usd.TimeCode(time)), width) for time in times]
        return Samples([time - shutter.frame for time in times], arrays)
    time = shutter.time if still else shutter.code(shutter.open)
    array = _floats(attribute.Get(time), width)
    return Samples([shutter.open], [array]) if len(array) else Samples()


def _read_rates(instances: Instances, rates: dict, shutter: Shutter, path, log: SceneLog) -> bool:
    """Reads velocities and the like; True where there are any that may count."""
    found = False
    for name, attribute in rates.items():
        if not attribute.HasAuthoredValue():
            continue
        try:
            times = samples_around(attribute, shutter)
            if not times:
                if shutter.moves:
                    text = f"its {attribute.GetName()} are ignored: they have no time samples"
                    log.warn(path, "velocities", text)
                continue
            # Only the sample at or before the frame has values, for no other is used.
            arrays = [_floats(None, 3)] * len(times)
            base = moving_sample(times, shutter)
            arrays[base] = _floats(attribute.Get(Usd.TimeCode(times[base])), 3)
        except FAULTS as error:
            warn_unreadable(log, path, error, f"its {attribute.GetName()} are ignored")
            continue
        setattr(instances, name, Samples([time - shutter.frame for time in times], arrays))
        found = found or (name != "accelerations" and arrays[base].size > 0)
    return found


def _mask(instancer: UsdGeom.PointInstancer, count: int, shutter: Shutter) -> np.ndarray:
    """1 for instances whose ids are neither invisible nor inactive; empty where all are there."""
    inactive = instancer.GetPrim().GetMetadata("inactiveIds")
    invisible = instancer.GetInvisibleIdsAttr().Get(shutter.time)
    masked = [list(inactive.explicitItems) if inactive else []]
    masked.append([] if invisible is None else _integers(invisible, np.int64))
    masked = np.concatenate([np.asarray(ids, dtype=np.int64) for ids in masked])
    if not len(masked):
        return np.zeros(0, dtype=np.uint8)
    ids = instancer.GetIdsAttr().Get(shutter.time)
    ids = np.arange(count) if ids is None else _integers(ids, np.int64)
    mask = ~np.isin(ids, masked)
    return np.zeros(0, dtype=np.uint8) if mask.all() else mask.astype(np.uint8)


def _changes_ids(instancer: UsdGeom.PointInstancer, shutter: Shutter) -> bool:
    """Whether samples within the shutter are of other instances than the frame's."""
    ids = instancer.GetIdsAttr()
    times = bracketing_samples(instancer.GetPositionsAttr(), shutter)
    if not times or not ids.ValueMightBeTimeVarying():
        return False
    frame = ids.Get(shutter.time)
    return any(ids.Get(Usd.TimeCode(time)) != frame for time in times)


def _has_values(attribute: Usd.Attribute) -> bool:
    """Whether it has any by default, or in its first sample: USD's rule for orientationsf."""
    times = [Usd.TimeCode.Default(), *map(Usd.TimeCode, attribute.GetTimeSamples()[:1])]
    return any(attribute.Get(time) for time in times)


def _floats(value, width: int) -> np.ndarray:
    if value is None:
        return np.zeros((0, width), dtype=np.float32)
    array = np.ascontiguousarray(value, dtype=np.float32)
    if array.size and (array.ndim != 2 or array.shape[1] != width):
        raise ValueError(f"not an array of {width} numbers each")
    return array.reshape(-1, width)


def _integers(value, dtype) -> np.ndarray:
    array = np.ascontiguousarray(value, dtype=dtype)
    if array.ndim != 1:
        raise ValueError("not an array of numbers")
    return array


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
