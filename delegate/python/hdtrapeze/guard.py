"""What keeps one faulty prim from ending the render: typed reads, and the faults of reading.

An attribute may be authored with another type than its schema says. Reading such a prim ends in
one of FAULTS, and whoever reads prims turns that into one warning which names the prim.
"""

from collections.abc import Iterable
from numbers import Real

from pxr import Tf, Usd

from .log import SceneLog

FAULTS = (
    Tf.ErrorException,
    TypeError,
    ValueError,
    LookupError,
    ArithmeticError,
    RuntimeError,
)
"""What USD, numpy and cffi raise for values of another type than was expected."""


def reason(error: Exception) -> str:
    """The message of a USD error without the C++ function it came from; others as they are."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" .'")]
    if isinstance(error, Tf.ErrorException):
        lines = [line.rsplit(" : ", 1)[-1].strip("' ") for line in lines]
    return "; ".join(lines) or type(error).__name__


def warn_unreadable(log: SceneLog, path, error: Exception, outcome: str) -> None:
    """The one warning about a prim that could not be read; `outcome` is what is done instead."""
    if isinstance(error, RecursionError):
        text = f"it is nested too deeply; {outcome}"
    else:
        text = f"an attribute has another type than USD's schema says ({reason(error)}); {outcome}"
    log.warn(path, "type", text)


def mistyped(prim: Usd.Prim, names: Iterable[str]) -> str | None:
    """The first of the named attributes with a value of another type than the schema says."""
    for name in names:
        attribute = prim.GetAttribute(name)
        expected = attribute.GetTypeName().type.pythonClass if attribute else None
        if expected and attribute.HasAuthoredValue():
            value = attribute.Get(Usd.TimeCode.EarliestTime())
            if value is not None and not isinstance(value, expected):
                return name
    return None


def number(attribute: Usd.Attribute, time: Usd.TimeCode) -> float:
    """The attribute's value; raises TypeError where it is no number."""
    value = attribute.Get(time)
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError(f"{attribute.GetName()} is {value!r}, which is no number")
    return float(value)


def number_or_fallback(attribute: Usd.Attribute, time: Usd.TimeCode, log: SceneLog) -> float:
    """The attribute's value, or with a warning its schema's fallback."""
    try:
        return number(attribute, time)
    except FAULTS as error:
        return fallback(attribute, error, log)


def fallback(attribute: Usd.Attribute, error: Exception, log: SceneLog):
    """The fallback of the attribute's schema, with a warning that it is used."""
    prim = attribute.GetPrim()
    value = prim.GetPrimDefinition().GetAttributeFallbackValue(attribute.GetName())
    log.warn(prim.GetPath(), "type", f"{reason(error)}; {value} is used")
    return value


def token(attribute: Usd.Attribute, known, time: Usd.TimeCode, log: SceneLog) -> str:
    """The attribute's value where it is among `known`, or with a warning its schema's fallback."""
    value = attribute.Get(time)
    if value in known:
        return value
    prim, name = attribute.GetPrim(), attribute.GetName()
    fallback = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
    text = f"{name} is {value!r}, which is none of {', '.join(known)}; {fallback} is used"
    log.warn(prim.GetPath(), f"token-{name}", text)
    return fallback
