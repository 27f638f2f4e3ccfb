"""Reads primvars as raw samples: those that are shaded with or give shape, those that AOVs want.

Nothing is checked here but that they hold numbers: the renderer checks counts and indices.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from .log import SceneLog
from .shutter import Shutter, between_blocks, bracketing_samples
from .typed import Mistyped, get

SHAPING = ("normals", "widths")
SHADED = ("displayColor", "displayOpacity", *SHAPING)
AOV_PREFIX = "primvars:"

TYPES = {
    "displayColor": Sdf.ValueTypeNames.Color3fArray,
    "displayOpacity": Sdf.ValueTypeNames.FloatArray,
    "normals": Sdf.ValueTypeNames.Normal3fArray,
    "widths": Sdf.ValueTypeNames.FloatArray,
}
"""USD's types of those that are shaded with; one value that is no array does as well."""

INTERPOLATIONS = {
    "constant": "CONSTANT",
    "uniform": "UNIFORM",
    "varying": "VARYING",
    "vertex": "VERTEX",
    "faceVarying": "FACE_VARYING",
}

NUMBERS = {
    np.dtype(np.float32): "FLOAT32",
    np.dtype(np.float64): "FLOAT64",
    np.dtype(np.float16): "FLOAT16",
    np.dtype(np.int32): "INT32",
    np.dtype(np.uint32): "UINT32",
    np.dtype(np.int64): "INT64",
    np.dtype(np.uint64): "UINT64",
    np.dtype(np.uint8): "UINT8",
}


WHOLE = {
    Sdf.ValueTypeNames.Int: np.int32,
    Sdf.ValueTypeNames.UInt: np.uint32,
    Sdf.ValueTypeNames.Int64: np.int64,
    Sdf.ValueTypeNames.UInt64: np.uint64,
    Sdf.ValueTypeNames.UChar: np.uint8,
}
"""Scalars of these types come as Python's int."""


@dataclass
class Sample:
    """A primvar at one time, relative to the frame."""

    time: float
    values: np.ndarray  # (n, width), of a type of NUMBERS
    indices: np.ndarray | None  # i32


@dataclass
class Primvar:
    """One primvar at one frame; all samples are of one type."""

    interpolation: str  # a key of INTERPOLATIONS
    samples: list[Sample]
    varies: bool  # may differ at another frame
    is_color: bool = False
    element_size: int = 1
    unauthored_index: int = -1

    def at_frame(self) -> Sample:
        """The values at the frame's own time, between the samples around it."""
        before = [sample for sample in self.samples if sample.time <= 0.0]
        after = [sample for sample in self.samples if sample.time > 0.0]
        first, second = (before or after)[-1 if before else 0], (after or before)[0]
        if not before or not after or first.values.shape != second.values.shape:
            return first
        f = -first.time / (second.time - first.time)
        return Sample(0.0, first.values + (second.values - first.values) * f, first.indices)


def wanted_primvars(aovs: Iterable[str]) -> tuple[str, ...]:
    """Names of the primvars that a render of these AOVs reads."""
    asked = (name[len(AOV_PREFIX) :] for name in aovs if name.startswith(AOV_PREFIX))
    return tuple(dict.fromkeys((*SHADED, *asked)))


def instance_primvars(instancer: Usd.Prim, names: Iterable[str]) -> list[str]:
    """Those of `names` that a point instancer has itself, to give them to its instances."""
    api = UsdGeom.PrimvarsAPI(instancer)
    names = [name for name in names if name not in SHAPING]
    return [name for name in names if api.GetPrimvar(name).HasAuthoredValue()]


def read_primvars(
    prim: Usd.Prim,
    shutter: Shutter,
    names: Iterable[str],
    log: SceneLog,
    hides: Callable[[str, Sdf.Path], bool] = lambda name, source: False,
) -> tuple[dict[str, Primvar], bool]:
    """The primvars of these names, and whether they may differ at another frame.

    What cannot be used is left out with a warning, and what something nearer hides without one:
    `hides` gets the name, and the path of the prim that has it.
    """
    found, varies = {}, False
    api = UsdGeom.PrimvarsAPI(prim)
    for name in names:
        primvar = api.FindPrimvarWithInheritance(name)
        if primvar and primvar.HasAuthoredValue():
            if hides(name, primvar.GetAttr().GetPrimPath()):
                continue
            authored = _Authored.of_primvar(primvar)
        else:
            authored = _attribute(prim, name)
        if authored is None:
            continue
        varies |= authored.varies
        read = _read(prim, name, authored, shutter, log)
        if read:
            found[name] = read
    return found, varies


@dataclass
class _Authored:
    attribute: Usd.Attribute
    interpolation: str
    indices: Usd.Attribute | None = None
    element_size: int = 1
    unauthored_index: int = -1
    fallback: str = "constant"
    """The interpolation where another than the known ones is authored."""

    @classmethod
    def of_primvar(cls, primvar: UsdGeom.Primvar):
        return cls(
            primvar.GetAttr(),
            primvar.GetInterpolation(),
            primvar.GetIndicesAttr() if primvar.IsIndexed() else None,
            primvar.GetElementSize(),
            primvar.GetUnauthoredValuesIndex(),
        )

    def times(self, shutter: Shutter) -> list[float]:
        """Times of its samples around the shutter, relative to the frame; else the frame's own."""
        found = set(bracketing_samples(self.attribute, shutter) or ())
        if self.indices:
            found.update(bracketing_samples(self.indices, shutter) or ())
        return sorted(time - shutter.frame for time in found) or [0.0]

    @property
    def varies(self) -> bool:
        return self.attribute.ValueMightBeTimeVarying() or bool(
            self.indices and self.indices.ValueMightBeTimeVarying()
        )


def _own(attribute: Usd.Attribute, interpolation: str) -> _Authored:
    return _Authored(attribute, interpolation, fallback="vertex")


def _attribute(prim: Usd.Prim, name: str) -> _Authored | None:
    """What schemas have as attributes of their own; a primvar of the name wins."""
    if name == "normals":
        points = UsdGeom.PointBased(prim)
        if points and points.GetNormalsAttr().HasAuthoredValue():
            return _own(points.GetNormalsAttr(), points.GetNormalsInterpolation())
    if name == "widths":
        for schema in (UsdGeom.Curves, UsdGeom.Points):
            wide = schema(prim)
            if wide and wide.GetWidthsAttr().HasAuthoredValue():
                return _own(wide.GetWidthsAttr(), wide.GetWidthsInterpolation())
    return None


def _read(prim, name: str, authored: _Authored, shutter: Shutter, log) -> Primvar | None:
    path = prim.GetPath()
    interpolation = authored.interpolation
    if interpolation not in INTERPOLATIONS:
        interpolation = authored.fallback
        text = f"{name} has the interpolation {authored.interpolation!r}, which is none of "
        text += f"{', '.join(INTERPOLATIONS)}; {interpolation} is used"
        log.warn(path, "primvar-interpolation", text)
    type_name = authored.attribute.GetTypeName()
    samples, blocks = [], []
    for time in authored.times(shutter):
        code = shutter.code(time)
        try:
            value, type_name = _typed(authored.attribute, code, TYPES.get(name))
            indices = get(authored.indices, code) if authored.indices else None
        except Mistyped as error:
            log.warn(path, "type", f"{error}; it is ignored")
            return None
        if value is None:
            blocks.append(time)
            continue
        values = _numbers(value, type_name)
        if values is None:
            text = f"{name} is of the type {type_name}, which holds no numbers; it is ignored"
            log.warn(path, "primvar-type", text)
            return None
        if indices is not None:
            indices = np.ascontiguousarray(indices, dtype=np.int32)
        if name in TYPES and values.dtype.kind in "iu":
            values = values.astype(np.float32)
        samples.append(Sample(time, values, indices))
    kept = between_blocks([sample.time for sample in samples], blocks)
    samples = [sample for sample in samples if sample.time in kept]
    if not any(sample.values.size for sample in samples):
        return None  # blocked, or authored but empty: as if not authored
    return Primvar(
        interpolation,
        samples,
        authored.varies,
        type_name.role == "Color",
        authored.element_size,
        authored.unauthored_index,
    )


def _typed(attribute: Usd.Attribute, code: Usd.TimeCode, expected: Sdf.ValueTypeName | None):
    """The value and its type; raises Mistyped where it is neither `expected` nor one of them."""
    try:
        return get(attribute, code, expected), expected or attribute.GetTypeName()
    except Mistyped:
        if expected is None:
            raise
        try:
            return get(attribute, code, expected.scalarType), expected.scalarType
        except Mistyped:
            pass
        raise


def _numbers(value, type_name: Sdf.ValueTypeName) -> np.ndarray | None:
    """(n, width) numbers of a value or an array of them; None for what is not numbers."""
    if type_name.scalarType == Sdf.ValueTypeNames.TimeCode:
        return None
    if isinstance(value, Gf.Quatf | Gf.Quatd | Gf.Quath):
        value = (*value.GetImaginary(), value.GetReal())  # as in arrays of them
    array = np.asarray(value, None if type_name.isArray else WHOLE.get(type_name))
    if array.dtype == np.bool_:
        array = array.astype(np.uint8)
    if array.dtype not in NUMBERS:
        return None
    count = len(array) if type_name.isArray else 1
    width = array.size // count if count else int(np.prod(array.shape[1:]))
    return np.ascontiguousarray(array.reshape(count, width or 1))
