"""Reads RenderProducts and their RenderVars.

A product says where it is written and overrides the settings prim; its vars say which AOVs it
holds. Of a faulty product or var there is one warning with its path, and the rest is rendered.
"""

from dataclasses import dataclass, field

from pxr import Usd, UsdGeom, UsdRender

from .guard import shown
from .log import SceneLog
from .settings import effect_values, image_values
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
    """A RenderProduct: fields of Options that it overrides, and what it holds."""

    prim: UsdRender.Product
    values: dict
    camera: UsdGeom.Camera | None = None
    """None: the settings', or the command's."""
    vars: list[RenderVar] = field(default_factory=list)

    @property
    def path(self) -> str:
        """The prim's path."""
        return str(self.prim.GetPath())

    def name_at(self, frame: float | None) -> str:
        """productName, which may have time samples; empty where there is none."""
        time = Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)
        value = self.prim.GetProductNameAttr().Get(time)
        return value if isinstance(value, str) else ""


def read_products(
    settings: UsdRender.Settings, unwritten: Unwritten, log: SceneLog
) -> list[Product]:
    """The products of a settings prim that can be written."""
    stage = settings.GetPrim().GetStage()
    products = []
    for target in targets_of(settings.GetProductsRel(), log):
        prim = UsdRender.Product(prim_at(stage, target))
        if not prim:
            if warn_target(settings.GetPrim(), "products", target, "RenderProduct", log):
                unwritten.refused.append(str(target))
            continue
        product = _read_product(prim, unwritten, log)
        if product is not None:
            products.append(product)
    return products


def _read_product(prim: UsdRender.Product, unwritten: Unwritten, log: SceneLog) -> Product | None:
    path = prim.GetPath()
    kind = prim.GetProductTypeAttr().Get()
    if kind != "raster":
        text = f"productType {kind} is not supported, only raster; not written"
        log.warn(path, "product-type", text)
        return None
    product = Product(prim, image_values(prim, log) | effect_values(prim, log))
    cameras = targets_of(prim.GetCameraRel(), log, one=True)
    if cameras:
        product.camera = UsdGeom.Camera(prim_at(prim.GetPrim().GetStage(), cameras[0]))
        if not product.camera:
            text = f"its camera {cameras[0]} is no camera; not written"
            log.warn(path, "camera", text)
            unwritten.refused.append(str(path))
            return None
    product.vars = _read_vars(prim, log)
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

    def text(name: str) -> str:
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
        source_name=text("sourceName"),
        source_type=text("sourceType"),
        data_type=text("dataType"),
        format=text(f"{DRIVER}format"),
        name=text(f"{DRIVER}name"),
        channel_prefix=text(f"{DRIVER}channel_prefix") if has_prefix else None,
    )
