"""Where copies of a subtree go: native instances and point instancers, nested at will.

A placement says for any time in the shutter where each copy is: (count, 4, 4) matrices that take
the space above the copied subtree to the world. Placements multiply: an instancer inside a
prototype of another has one copy for every pair. The renderer gets the result as samples with the
same keys for all instances, added where paths bend (see transforms.curve_keys).
"""

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .shutter import Shutter, bracketing_samples
from .transforms import Level, compose, curve_keys


class Placement:
    """Copies; `times` are the relative times at which keys are needed for sure."""

    def __init__(self, count: int, ids: np.ndarray, times: set[float]):
        self.count = count
        self.ids = ids
        self.times = times
        self._samples = {}

    def at(self, time: float) -> np.ndarray:
        """Matrices of all copies at `time`, (count, 4, 4)."""
        raise NotImplementedError

    def samples(self, shutter: Shutter) -> tuple[np.ndarray, np.ndarray]:
        """Key times (n,) and matrices (n, count, 4, 4); computed once a shutter."""
        if shutter not in self._samples:
            times = {shutter.open}
            if self.times:
                times |= {shutter.close, *self.times}
            self._samples[shutter] = curve_keys(sorted(times), self.at)
        return self._samples[shutter]


def _moving_times(levels: list[Level]) -> set[float]:
    return {float(t) for level in levels if not level.static for t in level.times}


class NativeInstances(Placement):
    """The instances of one prototype: levels from each instance up, then the outer placement."""

    def __init__(self, levels: list[list[Level]], outer: Placement | None):
        self._levels = levels
        self._outer = outer
        outer_count = outer.count if outer else 1
        times = set().union(*(_moving_times(one) for one in levels))
        if outer:
            times |= outer.times
        count = len(levels) * outer_count
        super().__init__(count, np.arange(count, dtype=np.int32), times)

    def at(self, time):
        inner = np.stack([compose(levels, time) for levels in self._levels])
        if self._outer is None:
            return inner
        return np.matmul(inner[:, None], self._outer.at(time)[None]).reshape(-1, 4, 4)


class PointInstances(Placement):
    """The instances of one prototype of a PointInstancer."""

    def __init__(
        self,
        instancer: "InstancerReader",
        chosen: np.ndarray,
        levels: list[Level],
        outer: Placement | None,
    ):
        self._instancer = instancer
        self._chosen = chosen
        self._levels = levels
        self._outer = outer
        times = instancer.times | _moving_times(levels)
        ids = chosen.astype(np.int32)
        if outer:
            times |= outer.times
            if outer.count > 1:
                ids = np.arange(len(chosen) * outer.count, dtype=np.int32)
        super().__init__(len(chosen) * (outer.count if outer else 1), ids, times)

    def at(self, time):
        inner = self._instancer.at(time)[self._chosen] @ compose(self._levels, time)
        if self._outer is None:
            return inner
        return np.matmul(inner[:, None], self._outer.at(time)[None]).reshape(-1, 4, 4)


class InstancerReader:
    """Reads one PointInstancer for one frame; USD computes the transforms at any time."""

    def __init__(self, instancer: UsdGeom.PointInstancer, shutter: Shutter, log: SceneLog):
        self._instancer = instancer
        self._shutter = shutter
        self._cache: dict[float, np.ndarray] = {}
        self.path = instancer.GetPath()
        self.indices = np.zeros(0, dtype=np.int32)
        self.times: set[float] = set()
        rates = (instancer.GetVelocitiesAttr(), instancer.GetAngularVelocitiesAttr())
        self._has_rates = any(rate.HasAuthoredValue() for rate in rates)
        self._read(log)

    def _read(self, log: SceneLog) -> None:
        instancer, shutter = self._instancer, self._shutter
        indices = instancer.GetProtoIndicesAttr().Get(shutter.time)
        positions = instancer.GetPositionsAttr().Get(shutter.time)
        if indices is None or positions is None or len(indices) == 0:
            return
        if len(indices) != len(positions):
            log.warn(
                self.path,
                "topology",
                f"{len(indices)} protoIndices but {len(positions)} positions: not rendered",
            )
            return
        self.indices = np.array(indices, dtype=np.int32)
        moving = (
            instancer.GetPositionsAttr(),
            instancer.GetOrientationsAttr(),
            instancer.GetOrientationsfAttr(),
            instancer.GetScalesAttr(),
        )
        for attribute in moving:
            samples = bracketing_samples(attribute, shutter)
            if samples:
                self.times.update(shutter.keys(samples))
        if shutter.moves and self._has_rates:
            self.times.update((shutter.open, shutter.close))
        try:
            first = self.at(shutter.open)
            if any(len(self.at(time)) != len(first) for time in sorted(self.times)):
                raise ValueError("their number changes within the shutter")
        except (ValueError, RuntimeError) as error:
            self.times.clear()
            self._cache.clear()
            try:
                first = self._compute(shutter.time)
                if len(first) != len(self.indices):
                    raise ValueError(str(error))
                self._cache = _Same(first)
                log.warn(self.path, "time-samples", f"the instances do not move: {error}")
            except (ValueError, RuntimeError):
                self.indices = self.indices[:0]
                log.warn(
                    self.path,
                    "topology",
                    "positions, orientations and scales do not fit together; it is not rendered",
                )

    def at(self, time: float) -> np.ndarray:
        """Matrices of all instances in the instancer's space, prototype's own excluded."""
        if time not in self._cache:
            self._cache[time] = self._compute(self._shutter.code(time))
        return self._cache[time]

    def _compute(self, time: Usd.TimeCode) -> np.ndarray:
        # With velocities USD moves the frame's samples along them; without, it interpolates.
        base = self._shutter.time if self._has_rates else time
        matrices = self._instancer.ComputeInstanceTransformsAtTimes(
            [time],
            base,
            UsdGeom.PointInstancer.ExcludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )[0]
        found = np.array(matrices, dtype=np.float64).reshape(-1, 4, 4)
        if len(found) != len(self.indices):
            raise ValueError(f"{len(found)} transforms for {len(self.indices)} instances")
        return found

    def visible(self) -> np.ndarray:
        """Which instances are neither invisible nor inactive."""
        mask = self._instancer.ComputeMaskAtTime(self._shutter.time)
        if len(mask) != len(self.indices):
            return np.ones(len(self.indices), dtype=bool)
        return np.array(mask, dtype=bool)


class _Same(dict):
    """A cache that has one answer for every time."""

    def __init__(self, value):
        super().__init__()
        self._value = value

    def __contains__(self, key):
        return True

    def __getitem__(self, key):
        return self._value
