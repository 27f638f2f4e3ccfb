"""Which renders a command makes of a frame, and what each of them writes.

Which images agree and share a render, where products are written and which of them cannot be, the
library plans, as for Hydra's hosts: here it is told what the stage says, and hears what to do.
"""

import math
from dataclasses import dataclass, field

from pxr import UsdGeom

from . import native
from .arrays import Arrays, text
from .camera import camera_aspect, settings_camera
from .errors import UsageError
from .log import SceneLog
from .options import Options
from .outputs import Output
from .planned import Planned
from .products import Product, fill_var, read_products
from .render import Renderer
from .request import Request
from .settings import Shape
from .unwritten import Unwritten

WHOLE = (0.0, 0.0, 1.0, 1.0)


@dataclass
class Render:
    """One render."""

    options: Options
    camera: UsdGeom.Camera | None
    outputs: list[Output] = field(default_factory=list)


@dataclass
class FramePlan:
    """What is rendered of a frame, in this order."""

    renders: list[Render]
    """That of the command's own image is the first."""
    own: Render | None = None
    """It, if that image can be."""
    refused: dict[str, str] = field(default_factory=dict)
    """Products that are not written, and why."""


class Planner:
    """Plans one frame of a command after the other."""

    def __init__(self, request: Request, with_products: bool, unwritten: Unwritten, log: SceneLog):
        self._request, self._unwritten, self._log = request, unwritten, log
        self._facts = {}
        if request.settings:
            self._facts["hdtrapeze/renderSettings"] = str(request.settings.GetPath())
        if request.render_pass:
            self._facts["hdtrapeze/renderPass"] = str(request.render_pass.GetPath())
        self._products: list[Product] = []
        self._camera = request.camera
        if request.settings and with_products:
            self._products = read_products(request.settings, request.shape, unwritten, log)
            self._camera = settings_camera(request.settings, log) or request.camera

    def plan(
        self, renderer: Renderer, frame: float | None, path: str = "", color: str | None = None
    ) -> FramePlan:
        """The renders of a frame, of which the command's own image goes to `path`."""
        request, arrays = self._request, Arrays()
        wanted = [request.product_options(product.values) for product in self._products]
        cameras = [product.camera or self._camera for product in self._products]
        products = [
            self._product(renderer, frame, product, options, camera, arrays)
            for product, options, camera in zip(self._products, wanted, cameras, strict=True)
        ]
        view = self._view(renderer, frame, path, arrays)
        *planned, own = renderer.session.plan(view, products)
        renders: dict[int, Render] = {}

        def add(file: Planned, options: Options, camera, output: Output) -> None:
            render = renders.setdefault(file.render, Render(options.planned(file), camera))
            render.outputs.append(output)

        plan = FramePlan([])
        for product, file, options, camera in zip(
            self._products, planned, wanted, cameras, strict=True
        ):
            if file.is_written:
                file = self._checked(product.path, file, options)
            if not file.is_written:
                plan.refused[product.path] = file.why
                self._unwritten.add(product.path, file)
                continue
            options.aovs = ["color"]
            output = Output(options, file.path, product.path)
            output.vars = [var for var in product.vars if renderer.session.render_var_aov(var)]
            output.metadata = self._facts | {"hdtrapeze/renderProduct": product.path}
            add(file, options, camera, output)
        if own.is_written:
            # Before the first ray: a crop without a pixel is a fault of the command.
            request.options.planned(own).data_window(own.width, own.height)
            output = Output(request.options, path, color=color, metadata=self._facts)
            add(own, request.options, request.camera, output)
            plan.own = renders[own.render]
        else:
            self._unwritten.add("", own)
        # What ends the command in a product has the image that is named by then.
        numbers = sorted(renders, key=lambda number: (renders[number] is not plan.own, number))
        plan.renders = [renders[number] for number in numbers]
        return plan

    def _checked(self, path: str, file: Planned, options: Options) -> Planned:
        """The file of a product; after a warning, why it cannot be cropped, of which the library
        does not know."""
        try:
            options.planned(file).data_window(file.width, file.height)
            return file
        except UsageError as error:
            why = str(error).removesuffix(".")
        why = why[:1].lower() + why[1:]
        self._log.warn(path, "product", f"{why}; it is not written")
        return Planned(native.constants().TRZ_ERROR_INVALID_ARGUMENT, why)

    def _view(self, renderer: Renderer, frame: float | None, path: str, arrays: Arrays):
        request = self._request
        options, camera, shape = request.options, request.camera, request.shape
        view = native.new("trz_view")
        view.camera = renderer.camera_id(_path(camera))
        view.camera_aspect = camera_aspect(camera, frame, self._log)
        # A crop or overscan is of the shape that the image comes to have: see Options.planned.
        image = options.whole_image(view.camera_aspect)
        view.settings = arrays.settings(_named(options), image)
        view.aovs, view.aov_count = arrays.texts(options.aovs), len(options.aovs)
        view.frame = math.nan if frame is None else frame
        view.path = arrays.text(path)
        if request.settings and shape:
            view.settings_path = arrays.text(str(request.settings.GetPath()))
            _fill_shape(view, self._windowed(shape), arrays)
            view.has_resolution = view.has_data_window = view.has_pixel_aspect = 1
            view.shapes_view, view.windows_view = request.takes_shape, request.takes_window
        return view

    def _product(
        self,
        renderer: Renderer,
        frame: float | None,
        product: Product,
        options: Options,
        camera: UsdGeom.Camera | None,
        arrays: Arrays,
    ):
        out = arrays.keep(native.new("trz_product"))
        out.path = arrays.text(product.path)
        out.type = arrays.text(product.kind)
        out.name = arrays.text(product.name_at(frame))
        out.camera_path = arrays.text(product.camera_path or _path(camera))
        if product.camera or not product.camera_path:
            out.camera = renderer.camera_id(_path(camera))
            out.camera_aspect = camera_aspect(camera, frame, self._log)
        _fill_shape(out, self._windowed(product.shape), arrays)
        out.settings = arrays.settings(_named(options), options.of_no_shape())
        vars_ = arrays.keep(native.ffi.new("trz_render_var[]", len(product.vars)))
        for place, var in zip(vars_, product.vars, strict=True):
            fill_var(place, var, arrays)
        out.vars, out.var_count = vars_, len(product.vars)
        out.var_target_count = product.var_targets
        return out

    def _windowed(self, shape: Shape) -> Shape:
        """The shape without its data window where a crop or overscan takes its place."""
        if not self._request.options.is_windowed:
            return shape
        return Shape(shape.resolution, shape.pixel_aspect, shape.conform, WHOLE)


def _fill_shape(out, shape: Shape, arrays: Arrays) -> None:
    out.resolution, out.data_window = shape.resolution, shape.data_window
    out.pixel_aspect = shape.pixel_aspect
    # Also an empty one: it is not the same as none.
    out.conform = arrays.keep(native.ffi.new("char[]", text(shape.conform)))


def _named(options: Options) -> dict:
    """Settings that tell images apart: not the backend, which need not be there for a plan."""
    return {name: value for name, value in options.named().items() if name != "backend"}


def _path(camera: UsdGeom.Camera | None) -> str:
    return str(camera.GetPath()) if camera else ""
