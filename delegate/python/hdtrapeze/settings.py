"""RenderSettings and RenderProduct prims as fields of Options, and the shapes of their images.

A product overrides only what it authors; the settings prim also speaks through its schema's
fallbacks. Attributes in the namespace `trapeze` are this renderer's own (see named), on either
prim. What cannot be used gives one warning with the prim's path, and is as if it were not there.
"""

from collections.abc import Callable
from dataclasses import dataclass

from pxr import Usd, UsdRender

from .errors import UsageError
from .guard import FAULTS, reason, shown
from .log import SceneLog
from .named import PREFIX, settings
from .options import Options
from .typed import Mistyped, get, warn_unknown

LINEAR_REC709 = ("lin_rec709_scene", "lin_rec709", "raw", "data", "")
"""renderingColorSpaces that ask for no more than what is done: displayColor as it is."""


def _flag(value) -> bool:
    if not isinstance(value, bool):
        raise TypeError("it must be true or false")
    return value


def _word(value) -> str:
    if not isinstance(value, str):
        raise TypeError("it must be a word")
    return value


@dataclass(frozen=True)
class Shape:
    """What a prim says of the shape of its image; whether that can be, the library decides."""

    resolution: tuple[int, int]
    pixel_aspect: float
    conform: str
    data_window: tuple[float, float, float, float]


SHAPE = {
    "resolution": ("resolution", lambda v: tuple(map(int, v))),
    "pixelAspectRatio": ("pixel_aspect", float),
    "aspectRatioConformPolicy": ("conform", str),
    "dataWindowNDC": ("data_window", lambda v: tuple(map(float, v))),
}
"""Attributes of a Shape."""

EFFECTS = {
    "disableMotionBlur": lambda v: {"motion_blur": not _flag(v)},
    "instantaneousShutter": lambda v: {"motion_blur": False} if _flag(v) else {},
    "disableDepthOfField": lambda v: {"defocus": not _flag(v)},
}
"""Attributes that switch effects off. instantaneousShutter is the old disableMotionBlur."""

HOSTS_TELL = ("timeCodesPerSecond",)
"""Settings of prims that only hosts need which do not know what a stage says."""


def read_shape(prim: UsdRender.SettingsBase, log: SceneLog, other: Shape | None = None) -> Shape:
    """The shape of an image, with `other` where the prim says nothing, else the schema's."""
    definition = prim.GetPrim().GetPrimDefinition()
    values = {}
    for name, (own, convert) in SHAPE.items():
        attribute = prim.GetPrim().GetAttribute(name)
        fallback = convert(definition.GetAttributeFallbackValue(name))
        values[own] = getattr(other, own) if other else fallback
        if not attribute.HasAuthoredValue():
            continue
        try:
            value = get(attribute, Usd.TimeCode.Default())
        except Mistyped as error:
            used = "the render settings'" if other else shown(fallback)
            log.warn(prim.GetPath(), "type", f"{error}; {used} is used")
            continue
        if value is not None:
            values[own] = convert(value)
    return Shape(**values)


def effect_values(prim: UsdRender.SettingsBase, log: SceneLog) -> dict:
    """Effects that are switched off, and the renderer's own settings."""
    return _read(prim, EFFECTS, log) | _trapeze_values(prim.GetPrim(), log)


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


def _read(prim: UsdRender.SettingsBase, readers: dict, log: SceneLog) -> dict:
    values = {}
    definition = prim.GetPrim().GetPrimDefinition()
    for name, convert in readers.items():
        attribute = prim.GetPrim().GetAttribute(name)
        fallback = definition.GetAttributeFallbackValue(name)
        if attribute.HasAuthoredValue():
            values |= _checked(attribute, convert, _used(prim.GetPrim(), fallback), log) or {}
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
