"""Primvars that are shaded with or give shape: displayColor, displayOpacity, normals, widths."""

from dataclasses import dataclass

import numpy as np
from pxr import UsdGeom

from .log import SceneLog
from .shutter import Shutter

WIDTHS = {"displayColor": 3, "displayOpacity": 1, "normals": 3, "widths": 1}

INTERPOLATIONS = {
    "constant": "CONSTANT",
    "uniform": "UNIFORM",
    "varying": "VARYING",
    "vertex": "VERTEX",
    "faceVarying": "FACE_VARYING",
}


@dataclass
class Primvar:
    """One primvar at one frame."""

    interpolation: str  # a key of INTERPOLATIONS
    values: np.ndarray  # (n, width) f32
    indices: np.ndarray | None  # i32
    varies: bool  # may differ at another frame


def read_primvars(mesh: UsdGeom.Gprim, shutter: Shutter, log: SceneLog) -> dict[str, Primvar]:
    """The primvars of `mesh` by name; what cannot be used is left out with a warning."""
    found = {}
    api = UsdGeom.PrimvarsAPI(mesh)
    for name in WIDTHS:
        primvar = api.FindPrimvarWithInheritance(name)
        if primvar and primvar.HasValue():
            indices = primvar.GetIndices(shutter.time) if primvar.IsIndexed() else None
            read = _make(
                mesh,
                name,
                primvar.Get(shutter.time),
                primvar.GetInterpolation(),
                indices,
                primvar.ValueMightBeTimeVarying(),
                log,
            )
            if read:
                found[name] = read
    for name, attribute, interpolation in _attributes(mesh):
        if name not in found and attribute.HasAuthoredValue():
            value, varies = attribute.Get(shutter.time), attribute.ValueMightBeTimeVarying()
            read = _make(mesh, name, value, interpolation, None, varies, log)
            if read:
                found[name] = read
    return found


def _attributes(mesh: UsdGeom.Gprim):
    """Name, attribute and interpolation of what schemas have beside primvars; primvars win."""
    points = UsdGeom.PointBased(mesh)
    if points:
        yield "normals", points.GetNormalsAttr(), points.GetNormalsInterpolation()
    for schema in (UsdGeom.Curves, UsdGeom.Points):
        wide = schema(mesh)
        if wide:
            yield "widths", wide.GetWidthsAttr(), wide.GetWidthsInterpolation()


def _make(mesh, name, value, interpolation, indices, varies, log) -> Primvar | None:
    if value is None:
        return None
    path, width = mesh.GetPath(), WIDTHS[name]
    if interpolation not in INTERPOLATIONS:
        text = f"{name} has the interpolation {interpolation!r}, which is none; it is ignored"
        log.warn(path, "primvar-interpolation", text)
        return None
    try:
        values = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        log.warn(path, "primvar-type", f"{name} does not hold numbers; it is ignored")
        return None
    if values.size == 0:
        return None  # authored, but empty: as if not authored
    if values.ndim <= 1 and values.size % width == 0 and (width == 1 or values.size == width):
        values = values.reshape(-1, width)
    if values.ndim != 2 or values.shape[1] != width:
        got = values.shape[1] if values.ndim == 2 else 1
        text = f"{name} has {got} numbers a value, not {width}; it is ignored"
        log.warn(path, "primvar-type", text)
        return None
    indices = None if indices is None else np.asarray(indices, dtype=np.int32)
    return Primvar(interpolation, np.ascontiguousarray(values), indices, varies)
