"""The renderer's own settings by name, as the library lists them: `trapeze:samples` and so on.

What there is, what it is for, its default and what it can be is the library's to say, for this host
as for Hydra's; nothing of that is repeated here.
"""

import functools
import re
from dataclasses import dataclass
from numbers import Integral, Real

from . import native
from .errors import NativeError

ffi = native.ffi

PREFIX = "trapeze:"


@dataclass(frozen=True)
class Setting:
    """One setting."""

    name: str
    """Without the prefix."""
    kind: type
    """Of its values: bool, int, float, str, or tuple for two numbers."""
    default: bool | int | float | str | None
    """Its value where nobody has an opinion; None: it has none."""
    least: float
    """The least number that it can be."""
    words: tuple[str, ...]
    """What it can be, where it is a text."""
    doc: str
    """What it is, as a part of a sentence."""
    of_prims: bool
    """Whether RenderSettings and RenderProduct prims have it, too."""

    @property
    def field(self) -> str:
        """The field of Options that it is: shadingRate is shading_rate."""
        return re.sub("[A-Z]", lambda letter: f"_{letter[0].lower()}", self.name)

    @property
    def title(self) -> str:
        """How a message begins that is about it: Shading rate."""
        return self.field.replace("_", " ").capitalize()

    def value(self, given):
        """`given` as a value of this setting.

        Raises TypeError where it is of another kind, and ValueError where it cannot be; either says
        what it must be.
        """
        assign(native.new("trz_settings"), self, given)
        if self.kind is tuple:
            return tuple(float(number) for number in given)
        return self.kind(given)


@functools.cache
def settings() -> dict[str, Setting]:
    """All settings by name, without the prefix, in the library's order."""
    found: dict[str, Setting] = {}
    described = native.new("trz_setting")
    while True:
        try:
            native.check(native.lib().trz_setting_describe(len(found), described))
        except NativeError as error:
            if error.code != native.constants().TRZ_ERROR_NOT_FOUND:
                raise
            return found
        name = _text(described.name).removeprefix(PREFIX)
        found[name] = Setting(
            name=name,
            kind=_kinds()[described.kind],
            default=_from_native(described.fallback),
            least=described.range[0],
            words=tuple(_text(described.words).split()),
            doc=_text(described.doc),
            of_prims=bool(described.of_prims),
        )


def assign(to, setting: Setting, given) -> None:
    """Sets what a setting stands for in a trz_settings; raises as Setting.value does."""
    value, text = _to_native(given)
    name = (PREFIX + setting.name).encode("utf-8")
    try:
        native.check(native.lib().trz_settings_set(to, name, value))
    except NativeError as error:
        kind = _kinds().get(value.kind)
        fits = kind is setting.kind or (kind, setting.kind) == (int, float)
        raise (ValueError if fits else TypeError)(str(error)) from None
    del text  # until here, the value points to it


def settings_struct(named: dict):
    """A trz_settings with the settings that are `named`, else the renderer's defaults."""
    value = native.new("trz_settings")
    native.check(native.lib().trz_settings_default(value))
    for name, given in named.items():
        assign(value, settings()[name], given)
    return value


def _kinds() -> dict[int, type]:
    constants = native.constants()
    return {
        constants.TRZ_VALUE_BOOL: bool,
        constants.TRZ_VALUE_INTEGER: int,
        constants.TRZ_VALUE_REAL: float,
        constants.TRZ_VALUE_TEXT: str,
        constants.TRZ_VALUE_PAIR: tuple,
    }


def _to_native(given) -> tuple:
    """A trz_value, and the text that it points to; without a kind where there is none for it."""
    constants, value, text = native.constants(), ffi.new("trz_value *"), None
    if isinstance(given, bool):
        value.kind, value.integer = constants.TRZ_VALUE_BOOL, given
    elif isinstance(given, Integral):
        # What does not fit is out of every range.
        value.kind = constants.TRZ_VALUE_INTEGER
        value.integer = max(-(1 << 63), min(int(given), (1 << 63) - 1))
    elif isinstance(given, Real):
        value.kind, value.numbers[0] = constants.TRZ_VALUE_REAL, float(given)
    elif isinstance(given, str):
        text = ffi.new("char[]", given.encode("utf-8"))
        value.kind, value.text = constants.TRZ_VALUE_TEXT, text
    elif hasattr(given, "__len__") and len(given) == 2 and all(map(_is_number, given)):
        value.kind, value.numbers = constants.TRZ_VALUE_PAIR, list(map(float, given))
    return value, text


def _is_number(value) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _from_native(value):
    kind = _kinds().get(value.kind)
    if kind is None:
        return None
    if kind is str:
        return _text(value.text)
    return kind(value.numbers[0] if kind is float else value.integer)


def _text(of_library) -> str:
    return ffi.string(of_library).decode("utf-8") if of_library else ""
