"""Reads UsdGeomNurbsCurves: counts, orders, knots, ranges and weights, and points as raw samples.

Nothing is checked here beyond the types: the renderer checks counts and knots, and warns. Widths
and normals are primvars, see primvars.py.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .curves import read_form
from .log import SceneLog
from .points import Points, read_points
from .shutter import Shutter
from .typed import get, get_or_ignore

_NO_NUMBERS = np.zeros(0)
_NO_COUNTS = np.zeros(0, dtype=np.int32)
OPTIONAL = ("ranges", "weights")


@dataclass
class NurbsBasis:
    """All of the curves but their points, as authored."""

    form: str = "DEFAULT"
    vertex_counts: np.ndarray = field(default_factory=lambda: _NO_COUNTS)
    orders: np.ndarray = field(default_factory=lambda: _NO_COUNTS)
    knots: np.ndarray = field(default_factory=lambda: _NO_NUMBERS)
    ranges: np.ndarray = field(default_factory=lambda: _NO_NUMBERS)  # (n, 2)
    weights: np.ndarray = field(default_factory=lambda: _NO_NUMBERS)
    varies: bool = False


@dataclass
class NurbsCurves:
    """Geometry of one prim of NURBS curves; see shapes.Shape."""

    basis: NurbsBasis
    points: Points
    kind: str = "nurbs_curves"

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a curve nor a point."""
        return not self.basis.vertex_counts.size and not any(
            array.size for array in self.points.arrays
        )

    @property
    def varies(self) -> bool:
        """Whether basis or points may differ at another frame."""
        return self.basis.varies or self.points.varies

    def send(self, session, prim: int, before: "NurbsCurves | None") -> None:
        """Sends basis and points, as far as `before` had others."""
        if before is None or before.basis is not self.basis:
            session.set_nurbs_curves(prim, self.basis)
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)


def read_nurbs_curves(
    prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: NurbsCurves | None
) -> NurbsCurves:
    """The curves at the frame; what does not vary is taken over from `before`."""
    curves = UsdGeom.NurbsCurves(prim)
    basis = before.basis if before else None
    if basis is None or basis.varies:
        basis = _read_basis(curves, shutter, log)
    points = before.points if before else None
    if points is None or points.varies or basis.varies:
        points = read_points(curves, shutter, basis.varies, log)
    return NurbsCurves(basis, points)


def _read_basis(curves: UsdGeom.NurbsCurves, shutter: Shutter, log: SceneLog) -> NurbsBasis:
    attributes = {
        "vertex_counts": (curves.GetCurveVertexCountsAttr(), np.int32),
        "orders": (curves.GetOrderAttr(), np.int32),
        "knots": (curves.GetKnotsAttr(), np.float64),
        "ranges": (curves.GetRangesAttr(), np.float64),
        "weights": (curves.GetPointWeightsAttr(), np.float64),
    }
    form, varies = read_form(curves, shutter, log)
    basis = NurbsBasis(form=form, varies=varies)
    for name, (attribute, dtype) in attributes.items():
        basis.varies |= attribute.ValueMightBeTimeVarying()
        if name in OPTIONAL:
            value = get_or_ignore(attribute, shutter.time, log)
        else:
            value = get(attribute, shutter.time)
        if value is not None and len(value):
            setattr(basis, name, np.ascontiguousarray(value, dtype=dtype))
    # Orders may be fewer than curves: those that are missing are none.
    missing = basis.vertex_counts.size - basis.orders.size
    basis.orders = np.pad(basis.orders, (0, max(missing, 0)))[: basis.vertex_counts.size]
    return basis
