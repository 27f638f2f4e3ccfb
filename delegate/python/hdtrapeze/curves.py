"""Reads UsdGeomBasisCurves: basis, wrap and counts, and points as raw samples.

Nothing is checked here beyond the types: the renderer counts segments and values, and warns.
Widths and normals are primvars, see primvars.py.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .mesh import Points, read_points
from .shutter import Shutter
from .typed import get, might_vary, token

TYPES = ("linear", "cubic")
BASES = {"bezier": "BEZIER", "bspline": "BSPLINE", "catmullRom": "CATMULL_ROM"}
WRAPS = {"nonperiodic": "NONPERIODIC", "periodic": "PERIODIC", "pinned": "PINNED"}
FORMS = {"auto": "AUTO", "ribbons": "RIBBONS", "tubes": "TUBES"}
FORM_PRIMVAR = "trapeze:curves"
"""A token, one of FORMS: what the curves are rendered as where they have no normals."""


@dataclass
class CurveTopology:
    """Names of the C ABI's constants, and counts as authored."""

    basis: str = "BEZIER"
    wrap: str = "NONPERIODIC"
    form: str = "DEFAULT"
    vertex_counts: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    varies: bool = False


@dataclass
class Curves:
    """Geometry of one prim of curves; see shapes.Shape."""

    topology: CurveTopology
    points: Points
    kind: str = "curves"

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a curve nor a point."""
        return not self.topology.vertex_counts.size and not any(
            array.size for array in self.points.arrays
        )

    @property
    def varies(self) -> bool:
        """Whether counts or points may differ at another frame."""
        return self.topology.varies or self.points.varies

    def send(self, session, prim: int, before: "Curves | None") -> None:
        """Sends topology and points, as far as `before` had others."""
        if before is None or before.topology is not self.topology:
            session.set_curves(prim, self.topology)
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)


def read_curves(prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Curves | None) -> Curves:
    """The curves at the frame; what does not vary is taken over from `before`."""
    curves = UsdGeom.BasisCurves(prim)
    topology = before.topology if before else None
    if topology is None or topology.varies:
        topology = _read_topology(curves, shutter, log)
    points = before.points if before else None
    if points is None or points.varies or topology.varies:
        points = read_points(curves, shutter, topology.varies, log)
    return Curves(topology, points)


def _read_topology(curves: UsdGeom.BasisCurves, shutter: Shutter, log: SceneLog) -> CurveTopology:
    counts = curves.GetCurveVertexCountsAttr()
    value = get(counts, shutter.time)
    form, form_varies = read_form(curves, shutter, log)
    array = np.ascontiguousarray([] if value is None else value, dtype=np.int32)
    words = curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr()
    linear = token(curves.GetTypeAttr(), TYPES, shutter.time, log) == "linear"
    return CurveTopology(
        basis="LINEAR" if linear else BASES[token(curves.GetBasisAttr(), BASES, shutter.time, log)],
        wrap=WRAPS[token(curves.GetWrapAttr(), WRAPS, shutter.time, log)],
        form=form,
        vertex_counts=array,
        varies=form_varies or might_vary(counts, *words),
    )


def read_form(curves: UsdGeom.Curves, shutter: Shutter, log: SceneLog) -> tuple[str, bool]:
    """What the curves are rendered as, a name of the C ABI's constants; and whether it may vary."""
    primvar = UsdGeom.PrimvarsAPI(curves).FindPrimvarWithInheritance(FORM_PRIMVAR)
    value = primvar.Get(shutter.time) if primvar and primvar.HasValue() else None
    varies = bool(primvar) and primvar.ValueMightBeTimeVarying()
    if value is None:
        return "DEFAULT", varies
    if not isinstance(value, str) or value not in FORMS:
        text = f"primvars:{FORM_PRIMVAR} is {value!r}, which is none of {', '.join(FORMS)}"
        log.warn(curves.GetPath(), "token-curves", f"{text}; it is ignored")
        return "DEFAULT", varies
    return FORMS[value], varies
