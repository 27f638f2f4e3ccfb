"""Transforms of prims as levels of the hierarchy, each with its own keys in time.

A level is the local matrix of one prim; static levels next to each other are folded into one. USD
interpolates the numbers of the transform ops (an angle, say), so between two authored samples the
matrix may follow a curve: keys are added, where the renderer asks for them, until straight lines
between them keep to the curve within TOLERANCE. A point's path is then what the stage says, up to
that tolerance.

Matrices are USD's: row vectors, row-major, local to parent, f64.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from . import native
from .guard import FAULTS, warn_unreadable
from .log import SceneLog
from .shutter import Shutter
from .typed import Mistyped, get

TOLERANCE = 2.5e-4
"""Largest distance of the curve from the line between keys: for the linear part relative to its
size, for the translation relative to the larger of that size and the path's extent. A wheel with
a radius of 500 pixels is off by at most an eighth of a pixel. The renderer's; tests know it."""

MAX_KEYS = 64
"""Keys of one level at most: a full turn keeps to a radius of 500 pixels within 0.6 pixels."""


@dataclass
class Level:
    """Matrices of one level at ascending times relative to the frame."""

    times: np.ndarray  # (n,)
    matrices: np.ndarray  # (n, 4, 4)

    @property
    def static(self) -> bool:
        return len(self.times) == 1

    def at(self, time: float) -> np.ndarray:
        """The matrix at `time`: keys are joined by lines, and hold outside."""
        if self.static or time <= self.times[0]:
            return self.matrices[0]
        if time >= self.times[-1]:
            return self.matrices[-1]
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        f = (time - self.times[i]) / (self.times[i + 1] - self.times[i])
        return self.matrices[i] * (1.0 - f) + self.matrices[i + 1] * f


def static_level(matrix: np.ndarray) -> Level:
    """A level that does not move."""
    return Level(np.zeros(1), np.asarray(matrix, dtype=np.float64).reshape(1, 4, 4))


def curve_keys(
    times: list[float], evaluate: Callable[[float], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Keys at `times` and, where `evaluate` bends between them, at more.

    `evaluate` gives one or several matrices, (..., 4, 4); all of them get the same keys. Where
    nothing moves, one key remains.
    """

    kept, matrices = _bent_keys(times, evaluate, "MATRICES")
    return np.array(kept), np.stack(matrices)


def point_keys(
    times: list[float], evaluate: Callable[[float], np.ndarray]
) -> tuple[list[float], list[np.ndarray]]:
    """The same for points, (n, 3): TOLERANCE is relative to the box around all of their paths."""
    return _bent_keys(times, evaluate, "POINTS")


def _bent_keys(times, evaluate, kind: str) -> tuple[list[float], list[np.ndarray]]:
    """Keys that keep to `evaluate`, as many as the renderer asks for."""
    known: list[float] = []
    values: list[np.ndarray] = []
    doubles: list[np.ndarray] = []
    missing = list(times)
    while missing:
        known += missing
        more = [evaluate(time) for time in missing]
        values += more
        doubles += [np.ascontiguousarray(value, dtype=np.float64) for value in more]
        missing, keep = native.next_on_path(kind, known, len(times), doubles)
    order = sorted(np.flatnonzero(keep), key=known.__getitem__)
    return [known[i] for i in order], [values[i] for i in order]


def compose(levels: list[Level], time: float) -> np.ndarray:
    """The product of `levels` at `time`, the prim's own level first."""
    matrix = np.eye(4)
    for level in levels:
        matrix = matrix @ level.at(time)
    return matrix


def fold(levels: list[Level]) -> list[Level]:
    """Multiplies neighbours that do not move; at least one level remains."""
    folded: list[Level] = []
    for level in levels:
        if folded and folded[-1].static and level.static:
            folded[-1] = static_level(folded[-1].matrices[0] @ level.matrices[0])
        else:
            folded.append(level)
    return folded or [static_level(np.eye(4))]


class TransformReader:
    """Reads levels for one frame, each prim once."""

    def __init__(self, shutter: Shutter, log: SceneLog):
        self._shutter = shutter
        self._log = log
        self._own: dict = {}

    def own_level(self, prim: Usd.Prim) -> tuple[Level | None, bool]:
        """The prim's local level (None: identity), and whether it ignores its parents."""
        path = prim.GetPath()
        if path not in self._own:
            try:
                self._own[path] = self._read(prim)
            except FAULTS as error:
                error = _mistyped_op(prim) or error
                warn_unreadable(self._log, path, error, "its transform is taken as none")
                self._own[path] = None, False
        return self._own[path]

    def replace_own(self, prim: Usd.Prim, level: Level) -> None:
        """Gives the prim another local level than its transform ops, for this frame."""
        self._own[prim.GetPath()] = level, self.own_level(prim)[1]

    def _read(self, prim: Usd.Prim) -> tuple[Level | None, bool]:
        xformable = UsdGeom.Xformable(prim)
        if not xformable:
            return None, False
        resets = xformable.GetResetXformStack()
        if not xformable.GetXformOpOrderAttr().HasAuthoredValue():
            return None, resets
        times = [self._shutter.open]
        if self._shutter.moves and xformable.TransformMightBeTimeVarying():
            times = self._shutter.keys(xformable.GetTimeSamples())
        held = prim.GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld

        def evaluate(time):
            return np.array(xformable.GetLocalTransformation(self._shutter.code(time)))

        if len(times) == 1 or held:
            return static_level(evaluate(self._shutter.open)), resets
        return Level(*curve_keys(times, evaluate)), resets

    def levels(
        self, prim: Usd.Prim, top: Usd.Prim | None = None, below: Usd.Prim | None = None
    ) -> list[Level]:
        """Levels from `prim` up to `top` (included), `below` (excluded) or the root; folded."""
        found = []
        while prim and not prim.IsPseudoRoot() and prim != below:
            level, resets = self.own_level(prim)
            if level is not None:
                found.append(level)
            if resets or prim == top:
                break
            prim = prim.GetParent()
        return fold(found)

    def resets_below(self, prim: Usd.Prim, below: Usd.Prim) -> bool:
        """Whether `prim` or a parent under `below` ignores its parents (resetXformStack)."""
        while prim and not prim.IsPseudoRoot() and prim != below:
            if self.own_level(prim)[1]:
                return True
            prim = prim.GetParent()
        return False


OP_TYPES = {
    "translate": Sdf.ValueTypeNames.Double3,
    "scale": Sdf.ValueTypeNames.Double3,
    "orient": Sdf.ValueTypeNames.Quatd,
    "transform": Sdf.ValueTypeNames.Matrix4d,
    "translateX": Sdf.ValueTypeNames.Double,
    "rotateX": Sdf.ValueTypeNames.Double,
    "rotateXYZ": Sdf.ValueTypeNames.Double3,
}
"""Types of transform ops in their highest precision; axes in whichever order."""


def _mistyped_op(prim: Usd.Prim) -> Mistyped | None:
    """What is wrong with the first transform op whose value is of another type than its kind's."""
    for attribute in prim.GetAttributes():
        parts = attribute.GetName().split(":")
        if parts[0] == "xformOp" and len(parts) > 1:
            stem = parts[1].rstrip("XYZ")
            axes = "XYZ"[: len(parts[1]) - len(stem)]
            expected = OP_TYPES.get(stem + axes)
            try:
                get(attribute, Usd.TimeCode.EarliestTime(), expected)
            except Mistyped as error:
                return error
    return None


class Between:
    """The way from one prim's space into another's, through the nearest parent of both."""

    def __init__(self, transforms: TransformReader, source: Usd.Prim, target: Usd.Prim):
        shared = source
        while shared and not target.GetPath().HasPrefix(shared.GetPath()):
            shared = shared.GetParent()
        if any(transforms.resets_below(prim, shared) for prim in (source, target)):
            shared = None
        self._up = transforms.levels(source, below=shared)
        self._down = transforms.levels(target, below=shared)
        moving = [level for level in self._up + self._down if not level.static]
        self.times = {float(time) for level in moving for time in level.times}
        """Relative times at which keys are needed for sure."""
        self.varies = any(_varies_below(prim, shared) for prim in (source, target))
        """Whether it may differ at another frame."""
        self._still = None if self.times else self._compute(0.0)

    def at(self, time: float) -> np.ndarray:
        """The matrix at `time`. Where the target is flat, what it cannot hold is left out."""
        return self._compute(time) if self._still is None else self._still

    def _compute(self, time: float) -> np.ndarray:
        down = compose(self._down, time)
        try:
            inverse = np.linalg.inv(down)
        except np.linalg.LinAlgError:
            inverse = np.linalg.pinv(down)
        return compose(self._up, time) @ inverse


def _varies_below(prim: Usd.Prim, below: Usd.Prim | None) -> bool:
    while prim and not prim.IsPseudoRoot() and prim != below:
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False
