"""What keeps one faulty prim from ending the render: the faults of reading.

Reading a prim that cannot be read ends in one of FAULTS, and whoever reads prims turns that into
one warning which names the prim.
"""

from collections.abc import Iterable
from contextlib import contextmanager

from pxr import Tf, Usd, UsdUtils

from .log import SceneLog
from .typed import Mistyped, get

FAULTS = (
    Tf.ErrorException,
    TypeError,
    ValueError,
    LookupError,
    ArithmeticError,
    RuntimeError,
)
"""What USD, numpy and cffi raise for values of another type than was expected."""

LONGEST = 100
"""Characters of a value that messages show."""


def shown(value) -> str:
    """A value for a message, as USD's text files write it; long arrays are cut off."""
    if isinstance(value, str):
        return repr(value)
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


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
    elif isinstance(error, Mistyped):
        text = f"{error}; {outcome}"
    else:
        text = f"it cannot be read ({reason(error)}); {outcome}"
    log.warn(path, "type", text)


@contextmanager
def quiet():
    """Within it, USD says nothing on stderr."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        delegate.TakeUncoalescedDiagnostics()
        del delegate


def mistyped(prim: Usd.Prim, names: Iterable[str]) -> str | None:
    """What is wrong with the first of the named attributes whose type is not just the schema's.

    For what USD reads by itself, which takes no other.
    """
    for name in names:
        attribute = prim.GetAttribute(name)
        if attribute and attribute.HasAuthoredValue():
            try:
                get(attribute, Usd.TimeCode.EarliestTime(), exact=True)
            except Mistyped as error:
                return str(error)
    return None
