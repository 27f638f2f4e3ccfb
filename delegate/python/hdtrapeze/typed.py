"""Typed reads of attributes: the one place where a value's type is compared with its schema's.

An attribute may be authored with another type than its schema says, and USD hands out what is
authored. Where the type stands for the schema's without loss (another precision or role, whole
numbers for real ones) the value is taken; any other counts as if it were not authored, with one
warning that names the prim, the attribute and both types. Words are compared with those that the
schema allows.
"""

import difflib
from collections.abc import Iterable

import numpy as np
from pxr import Gf, Sdf, Tf, Usd

from .log import SceneLog

_T = Sdf.ValueTypeNames
_REALS = (_T.Half, _T.Float, _T.Double)
_WHOLE = (_T.Int, _T.UInt, _T.Int64, _T.UInt64, _T.UChar)
_VECTORS = {
    2: (_T.Half2, _T.Float2, _T.Double2),
    3: (_T.Half3, _T.Float3, _T.Double3),
    4: (_T.Half4, _T.Float4, _T.Double4),
}
_WHOLE_VECTORS = {2: _T.Int2, 3: _T.Int3, 4: _T.Int4}


def _stand_ins() -> dict[Tf.Type, set[Tf.Type]]:
    """For each scalar type those whose values do for it."""
    families = [(_REALS, (*_REALS, *_WHOLE)), (_WHOLE, _WHOLE)]
    families += [(own, (*own, _WHOLE_VECTORS[n])) for n, own in _VECTORS.items()]
    families.append(((_T.Quath, _T.Quatf, _T.Quatd),) * 2)
    return {one.type: {other.type for other in others} for own, others in families for one in own}


_STAND_INS = _stand_ins()


class Mistyped(TypeError):
    """A value has another type than its attribute's schema says; the text names both."""


def accepts(expected: Sdf.ValueTypeName, found: Sdf.ValueTypeName) -> bool:
    """Whether values of the type `found` do where `expected` is asked for."""
    if expected.type == found.type:
        return True
    if expected.isArray != found.isArray:
        return False
    return found.scalarType.type in _STAND_INS.get(expected.scalarType.type, ())


def get(
    attribute: Usd.Attribute,
    time: Usd.TimeCode,
    expected: Sdf.ValueTypeName | None = None,
    exact: bool = False,
):
    """The value at `time`, None where there is none; raises Mistyped.

    `expected` is the schema's type, for attributes that are in no schema. With `exact` nothing else
    stands for it, as for what USD itself reads.
    """
    value = attribute.Get(time)
    if value is None:
        return None
    expected = expected or attribute.GetTypeName()
    of_arrays = expected.type.pythonClass  # and of vectors; there is none for other scalars
    if of_arrays is not None and type(value) is of_arrays:
        return value
    if type(value) is float and expected in _REALS and not exact:
        return value  # of whichever precision
    found = _authored_type(attribute, time, value)
    if found.type != expected.type and (exact or not accepts(expected, found)):
        name = attribute.GetName()
        raise Mistyped(f"{name} has the type {found}, where {expected} is expected")
    if found.type != expected.type and expected.scalarType == _T.Int:
        numbers = np.asarray(value)
        if (numbers != numbers.astype(np.int32)).any():
            raise Mistyped(f"{attribute.GetName()} has numbers that are too large for {expected}")
    return value


def get_or_ignore(
    attribute: Usd.Attribute,
    time: Usd.TimeCode,
    log: SceneLog,
    expected: Sdf.ValueTypeName | None = None,
    outcome: str = "it is ignored",
):
    """As `get`; where the type is another, None with a warning."""
    try:
        return get(attribute, time, expected)
    except Mistyped as error:
        log.warn(attribute.GetPrim().GetPath(), "type", f"{error}; {outcome}")
        return None


def get_or_fallback(
    attribute: Usd.Attribute,
    time: Usd.TimeCode,
    log: SceneLog,
    frame: Usd.TimeCode | None = None,
):
    """As `get`; where the type is another or the value is blocked, the schema's fallback with a
    warning.

    With `frame`, which `time` is a key around, a block between the two holds the value that is on
    the frame's side of it; only what is blocked at the frame itself has the fallback.
    """
    try:
        within = time if frame is None else up_to_block(attribute, time, frame)
        value = get(attribute, within)
        why = f"{attribute.GetName()} is blocked by a time sample"
    except Mistyped as error:
        value, why = None, str(error)
    if value is not None:
        return value
    value = _fallback(attribute)
    if value is not None or attribute.HasAuthoredValue():
        used = "it is ignored" if value is None else f"{_shown(value)} is used"
        log.warn(attribute.GetPrim().GetPath(), "type", f"{why}; {used}")
    return value


def _shown(value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def up_to_block(attribute: Usd.Attribute, time: Usd.TimeCode, frame: Usd.TimeCode) -> Usd.TimeCode:
    """`time`, or the last sample on the way to it that no block is before; else `frame`."""
    if time == frame or not attribute.ValueMightBeTimeVarying():
        return time
    ends = frame.GetValue(), time.GetValue()
    samples = attribute.GetTimeSamplesInInterval(Gf.Interval(min(ends), max(ends)))
    kept = frame
    for sample in [*(samples if ends[0] < ends[1] else reversed(samples)), time]:
        code = Usd.TimeCode(sample)
        if attribute.Get(code) is None:
            return kept
        kept = code
    return time


def token(attribute: Usd.Attribute, known, time: Usd.TimeCode, log: SceneLog) -> str:
    """The value where it is among `known`; else the schema's fallback with a warning."""
    value = get_or_fallback(attribute, time, log)
    if value in known:
        return value
    fallback = _fallback(attribute)
    if value is not None:
        name = attribute.GetName()
        text = f"{name} is {value!r}, which is none of {', '.join(known)}; {fallback} is used"
        log.warn(attribute.GetPrim().GetPath(), f"token-{name}", text)
    return fallback


def warn_unknown(prim: Usd.Prim, known: Iterable[str], what: str, log: SceneLog) -> None:
    """A warning about each authored trapeze:NAME of which NAME is not among `known`."""
    for found in prim.GetAuthoredPropertiesInNamespace("trapeze"):
        name = found.GetName().removeprefix("trapeze:")
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.5)
            hint = f"did you mean trapeze:{near[0]}?" if near else f"known are {', '.join(known)}"
            text = f"trapeze:{name} is no {what}: {hint}"
            log.warn(prim.GetPath(), "unknown-attribute", text)


def _fallback(attribute: Usd.Attribute):
    definition = attribute.GetPrim().GetPrimDefinition()
    return definition.GetAttributeFallbackValue(attribute.GetName())


def _authored_type(attribute, time: Usd.TimeCode, value) -> Sdf.ValueTypeName:
    """The type that the strongest opinion with a value has."""
    for spec in attribute.GetPropertyStack(time):
        has_samples = spec.layer.GetNumTimeSamplesForPath(spec.path)
        if has_samples or spec.HasDefaultValue():
            return spec.typeName
    # A fallback, or the value of a clip.
    if isinstance(value, str):
        return attribute.GetTypeName()
    return Sdf.GetValueTypeNameForValue(value)


def might_vary(*attributes: Usd.Attribute) -> bool:
    """Whether one of them may have another value at another frame.

    Uniform ones as well: USD gives the value of the frame where they have time samples.
    """
    return any(attribute.ValueMightBeTimeVarying() for attribute in attributes)
