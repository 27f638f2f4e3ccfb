"""RenderSettings and RenderProduct prims as fields of Options.

A product overrides only what it authors; the settings prim also speaks through its schema's
fallbacks. Attributes in the namespace `trapeze` are this renderer's own (see named), on either
prim. What cannot be used gives one warning with the prim's path, and is as if it were not there.
"""

from collections.abc import Callable
from numbers import Integral, Real

from pxr import Usd, UsdRender

from .errors import UsageError
from .guard import FAULTS, reason, shown
from .log import SceneLog
from .named import PREFIX, settings
from .options import Options
from .typed import Mistyped, get, warn_unknown

CONFORM_POLICIES = {
    "expandAperture": "fit",
    "cropAperture": "crop",
    "adjustApertureWidth": "matchVertically",
    "adjustApertureHeight": "matchHorizontally",
    "adjustPixelAspectRatio": "dontConform",
}
"""aspectRatioConformPolicy as window policies."""

LINEAR_REC709 = ("lin_rec709_scene", "lin_rec709", "raw", "data", "")
"""renderingColorSpaces that ask for no more than what is done: displayColor as it is."""


def _integer(value) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise TypeError("it must be a whole number")
    return int(value)


def _number(value) -> float:
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError("it must be a number")
    return float(value)


def _flag(value) -> bool:
    if not isinstance(value, bool):
        raise TypeError("it must be true or false")
    return value


def _word(value) -> str:
    if not isinstance(value, str):
        raise TypeError("it must be a word")
    return value


def _numbers(count: int, one: Callable = _number) -> Callable:
    def convert(value) -> tuple:
        if isinstance(value, str) or not hasattr(value, "__len__"):
            raise TypeError(f"it must be {count} numbers")
        numbers = tuple(one(number) for number in value)
        if len(numbers) != count:
            raise TypeError(f"it must be {count} numbers")
        return numbers

    return convert


def _policy(value) -> str:
    try:
        return CONFORM_POLICIES[value]
    except (KeyError, TypeError):
        raise ValueError(f"known are {', '.join(CONFORM_POLICIES)}") from None


def _data_window(value) -> dict:
    window = _numbers(4)(value)
    return {"data_window_ndc": None if window == (0.0, 0.0, 1.0, 1.0) else window}


IMAGE = {
    "resolution": lambda v: dict(zip(("width", "height"), _numbers(2, _integer)(v), strict=True)),
    "pixelAspectRatio": lambda v: {"pixel_aspect": _number(v)},
    "aspectRatioConformPolicy": lambda v: {"window_policy": _policy(v)},
    "dataWindowNDC": _data_window,
}
"""Attributes of the image's shape."""

EFFECTS = {
    "disableMotionBlur": lambda v: {"motion_blur": not _flag(v)},
    "instantaneousShutter": lambda v: {"motion_blur": False} if _flag(v) else {},
    "disableDepthOfField": lambda v: {"defocus": not _flag(v)},
}
"""Attributes that switch effects off. instantaneousShutter is the old disableMotionBlur."""

HOSTS_TELL = ("timeCodesPerSecond",)
"""Settings of prims that only hosts need which do not know what a stage says."""


def image_values(prim: UsdRender.SettingsBase, log: SceneLog, fallbacks: bool = False) -> dict:
    """The image's shape; with `fallbacks` also what the schema says where nothing is authored."""
    return _read(prim, IMAGE, log, fallbacks)


def effect_values(prim: UsdRender.SettingsBase, log: SceneLog) -> dict:
    """Effects that are switched off, and the renderer's own settings."""
    return _read(prim, EFFECTS, log, False) | _trapeze_values(prim.GetPrim(), log)


def purpose_values(settings: UsdRender.Settings, log: SceneLog) -> dict:
    """includedPurposes, where they are authored."""

    def convert(value) -> dict:
        return {"purposes": [_word(purpose) for purpose in value if purpose != "default"]}

    attribute = settings.GetIncludedPurposesAttr()
    if not attribute.HasAuthoredValue():
        return {}
    return _checked(attribute, convert, "default and proxy are rendered", log) or {}


def check_unused(settings: UsdRender.Settings, log: SceneLog) -> None:
    """Says what the settings ask for that the renderer does not do."""
    path = settings.GetPath()
    space = settings.GetRenderingColorSpaceAttr().Get()
    if space and space not in LINEAR_REC709:
        text = f"renderingColorSpace {space} is not supported: linear Rec. 709 is rendered"
        log.warn(path, "color-space", text)
    if settings.GetMaterialBindingPurposesAttr().HasAuthoredValue():
        text = "materialBindingPurposes has no effect: materials are not used yet"
        log.say(20, str(path), "unsupported-shading", text)


def _read(prim: UsdRender.SettingsBase, readers: dict, log: SceneLog, fallbacks: bool) -> dict:
    values = {}
    definition = prim.GetPrim().GetPrimDefinition()
    for name, convert in readers.items():
        attribute = prim.GetPrim().GetAttribute(name)
        fallback = definition.GetAttributeFallbackValue(name)
        if attribute.HasAuthoredValue():
            found = _checked(attribute, convert, _used(prim.GetPrim(), fallback), log)
            if found is not None:
                values |= found
                continue
        if fallbacks:
            values |= convert(fallback)
    return values


def _used(prim: Usd.Prim, fallback) -> str:
    """What is used in place of a value that cannot be."""
    if prim.IsA(UsdRender.Product):
        return "the render settings' is used"
    return f"{shown(fallback)} is used"


def _trapeze_values(prim: Usd.Prim, log: SceneLog) -> dict:
    values = {}
    known = {name: setting for name, setting in settings().items() if setting.of_prims}
    warn_unknown(prim, known, "setting of this renderer", log)
    for attribute in prim.GetAuthoredPropertiesInNamespace(PREFIX.removesuffix(":")):
        setting = known.get(attribute.GetName().removeprefix(PREFIX))
        if not isinstance(attribute, Usd.Attribute) or not setting or setting.name in HOSTS_TELL:
            continue
        used = "it is ignored" if setting.default is None else _used(prim, setting.default)
        found = _checked(attribute, lambda v, own=setting: {own.field: own.value(v)}, used, log)
        values |= found or {}
    return values


def _checked(attribute: Usd.Attribute, convert: Callable, used: str, log: SceneLog) -> dict | None:
    """What the attribute sets, None where it is blocked; or None with a warning, which says what
    is `used`."""
    try:
        value = get(attribute, Usd.TimeCode.Default())
    except Mistyped as error:
        log.warn(attribute.GetPrim().GetPath(), "type", f"{error}; {used}")
        return None
    if value is None:
        return None
    try:
        found = convert(value)
        Options(**found).validate()
        return found
    except UsageError as error:
        why = str(error)
    except FAULTS as error:
        why = reason(error)
        if attribute.IsCustom() and isinstance(error, TypeError):
            why += f", and is of the type {attribute.GetTypeName()}"
    why = why[:1].lower() + why[1:].removesuffix(".")
    text = f"{attribute.GetName()} is {shown(value)}, which cannot be: {why}; {used}"
    log.warn(attribute.GetPrim().GetPath(), "render-settings", text)
    return None
