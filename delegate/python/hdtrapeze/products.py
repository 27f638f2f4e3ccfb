"""Reads RenderProducts and their RenderVars.

A product says where it is written and overrides the settings prim; its vars say which AOVs it
holds. Of a faulty product or var there is one warning with its path, and the rest is rendered.
"""

from dataclasses import dataclass, field

from pxr import Usd, UsdGeom, UsdRender

from .arrays import Arrays, text
from .guard import shown
from .log import SceneLog
from .native import ffi
from .settings import Shape, effect_values, read_shape
from .targets import prim_at, targets_of, warn_target
from .unwritten import Unwritten

DRIVER = "driver:parameters:aov:"
"""Namespace in which other renderers and their exporters keep names and formats of AOVs."""


@dataclass(frozen=True)
class RenderVar:
    """A RenderVar as authored; empty where nothing is."""

    path: str
    source_name: str = ""
    source_type: str = ""
    data_type: str = ""
    format: str = ""
    name: str = ""
    channel_prefix: str | None = None


@dataclass
class Product:
    """A RenderProduct as authored."""

    prim: UsdRender.Product
    values: dict
    """Fields of Options that it overrides."""
    shape: Shape
    """Of its image, with the settings' where it says nothing."""
    camera: UsdGeom.Camera | None = None
    """None: the settings', or the command's."""
    camera_path: str = ""
    """The camera that it names, which may be none."""
    vars: list[RenderVar] = field(default_factory=list)
    var_targets: int = 0
    """How many prims orderedVars names, also such as are no vars."""

    @property
    def path(self) -> str:
        """The prim's path."""
        return str(self.prim.GetPath())

    @property
    def kind(self) -> str:
        """productType."""
        return str(self.prim.GetProductTypeAttr().Get() or "")

    def name_at(self, frame: float | None) -> str:
        """productName, which may have time samples; empty where there is none."""
        time = Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)
        value = self.prim.GetProductNameAttr().Get(time)
        return value if isinstance(value, str) else ""


def read_products(
    settings: UsdRender.Settings, shape: Shape, unwritten: Unwritten, log: SceneLog
) -> list[Product]:
    """The products of a settings prim, of the shape that it says."""
    stage = settings.GetPrim().GetStage()
    products = []
    for target in targets_of(settings.GetProductsRel(), log):
        prim = UsdRender.Product(prim_at(stage, target))
        if not prim:
            if warn_target(settings.GetPrim(), "products", target, "RenderProduct", log):
                unwritten.refused.append(str(target))
            continue
        products.append(_read_product(prim, shape, log))
    return products


def _read_product(prim: UsdRender.Product, shape: Shape, log: SceneLog) -> Product:
    product = Product(prim, effect_values(prim, log), read_shape(prim, log, shape))
    cameras = targets_of(prim.GetCameraRel(), log, one=True)
    if cameras:
        product.camera_path = str(cameras[0])
        product.camera = UsdGeom.Camera(prim_at(prim.GetPrim().GetStage(), cameras[0])) or None
    product.vars = _read_vars(prim, log)
    product.var_targets = len(prim.GetOrderedVarsRel().GetTargets())
    return product


def _read_vars(product: UsdRender.Product, log: SceneLog) -> list[RenderVar]:
    stage = product.GetPrim().GetStage()
    relationship = product.GetOrderedVarsRel()
    found = []
    for target in targets_of(relationship, log):
        var = UsdRender.Var(prim_at(stage, target))
        if var:
            found.append(_read_var(var, log))
        else:
            warn_target(product.GetPrim(), "orderedVars", target, "RenderVar", log)
    return found


def _read_var(var: UsdRender.Var, log: SceneLog) -> RenderVar:
    prim = var.GetPrim()

    def read(name: str) -> str:
        attribute = prim.GetAttribute(name)
        if not attribute.HasAuthoredValue():
            return ""
        value = attribute.Get()
        if isinstance(value, str):
            return value
        log.warn(prim.GetPath(), "type", f"{name} is {shown(value)}, which is no text; ignored")
        return ""

    has_prefix = prim.GetAttribute(f"{DRIVER}channel_prefix").HasAuthoredValue()
    return RenderVar(
        path=str(prim.GetPath()),
        source_name=read("sourceName"),
        source_type=read("sourceType"),
        data_type=read("dataType"),
        format=read(f"{DRIVER}format"),
        name=read(f"{DRIVER}name"),
        channel_prefix=read(f"{DRIVER}channel_prefix") if has_prefix else None,
    )


def fill_var(place, var: RenderVar, arrays: Arrays) -> None:
    """Fills a trz_render_var; what is empty is not authored, but for an empty prefix."""
    for name, value in vars(var).items():
        if value or (name == "channel_prefix" and value is not None):
            setattr(place, name, arrays.keep(ffi.new("char[]", text(value))))
