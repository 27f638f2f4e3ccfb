"""Reads UsdGeomNurbsPatch: orders, knots, ranges and weights, and points as raw samples.

Nothing is checked here beyond the types: the renderer checks counts and knots, and warns. The form
is not read: a patch is closed where its boundaries lie on one another.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .mesh import ORIENTATIONS
from .points import Points, read_points
from .shutter import Shutter
from .typed import get, get_or_ignore, might_vary, token

_NO_NUMBERS = np.zeros(0)


@dataclass
class Basis:
    """All of a patch but its points; pairs are along u and along v."""

    orders: tuple[int, int] = (0, 0)
    vertex_counts: tuple[int, int] = (0, 0)
    knots: tuple[np.ndarray, np.ndarray] = (_NO_NUMBERS, _NO_NUMBERS)
    ranges: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    """From and to; 0 and 0 where nothing is authored."""
    weights: np.ndarray = field(default_factory=lambda: _NO_NUMBERS)
    orientation: str = "rightHanded"
    varies: bool = False


@dataclass
class NurbsPatch:
    """Geometry of one patch; see shapes.Shape."""

    basis: Basis
    points: Points
    kind: str = "nurbs_patch"

    @property
    def is_empty(self) -> bool:
        """Whether there are no points."""
        return not any(array.size for array in self.points.arrays)

    @property
    def varies(self) -> bool:
        """Whether basis or points may differ at another frame."""
        return self.basis.varies or self.points.varies

    def send(self, session, prim: int, before: "NurbsPatch | None") -> None:
        """Sends basis and points, as far as `before` had others."""
        if before is None or before.basis is not self.basis:
            session.set_nurbs_patch(prim, self.basis)
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)


def read_nurbs_patch(
    prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: NurbsPatch | None
) -> NurbsPatch:
    """The patch at the frame; what does not vary is taken over from `before`."""
    patch = UsdGeom.NurbsPatch(prim)
    if get_or_ignore(patch.GetTrimCurveCountsAttr(), shutter.time, log):
        text = "its trim curves are not supported: it is rendered untrimmed"
        log.warn(prim.GetPath(), "unsupported-trim", text)
    basis = before.basis if before else None
    if basis is None or basis.varies:
        basis = _read_basis(patch, shutter, log)
    points = before.points if before else None
    if points is None or points.varies or basis.varies:
        points = read_points(patch, shutter, basis.varies, log)
    return NurbsPatch(basis, points)


def _read_basis(patch: UsdGeom.NurbsPatch, shutter: Shutter, log: SceneLog) -> Basis:
    orientation = patch.GetOrientationAttr()
    varies = might_vary(orientation)

    def read(attribute: Usd.Attribute, fallback, needed: bool = True):
        nonlocal varies
        varies |= attribute.ValueMightBeTimeVarying()
        time = shutter.time
        value = get(attribute, time) if needed else get_or_ignore(attribute, time, log)
        return fallback if value is None else value

    def numbers(attribute: Usd.Attribute, needed: bool = True) -> np.ndarray:
        return np.ascontiguousarray(read(attribute, (), needed), dtype=np.float64)

    basis = Basis(
        orders=(int(read(patch.GetUOrderAttr(), 0)), int(read(patch.GetVOrderAttr(), 0))),
        vertex_counts=(
            int(read(patch.GetUVertexCountAttr(), 0)),
            int(read(patch.GetVVertexCountAttr(), 0)),
        ),
        knots=(numbers(patch.GetUKnotsAttr()), numbers(patch.GetVKnotsAttr())),
        ranges=(
            tuple(read(patch.GetURangeAttr(), (0.0, 0.0), False)),
            tuple(read(patch.GetVRangeAttr(), (0.0, 0.0), False)),
        ),
        weights=numbers(patch.GetPointWeightsAttr(), needed=False),
        orientation=token(orientation, ORIENTATIONS, shutter.time, log),
    )
    basis.varies = varies
    return basis
