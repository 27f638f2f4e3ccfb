"""Which renders a command makes, and what each of them writes.

Images that agree in camera, resolution and every other setting share one render; their AOVs are
rendered together. All others are renders of their own, one after the other, in one session.
"""

import os
from dataclasses import dataclass, replace

from pxr import UsdGeom

from .camera import settings_camera
from .errors import OutputError, SceneError
from .frames import OutputPath
from .log import SceneLog
from .options import Options
from .outputs import Output
from .products import Product, RenderVar, read_products
from .request import Request
from .session import Session
from .settings import image_values
from .unwritten import Unwritten


@dataclass
class Render:
    """One render a frame."""

    options: Options
    camera: UsdGeom.Camera | None
    outputs: list[Output]

    def agrees(self, options: Options, camera: UsdGeom.Camera | None) -> bool:
        """Whether an image of these options is this render's."""
        return _path(camera) == _path(self.camera) and _shared(options) == _shared(self.options)

    def add(self, output: Output, aovs: list[str]) -> None:
        """Writes one file more."""
        self.outputs.append(output)
        self.options.aovs = list(dict.fromkeys([*self.options.aovs, *aovs]))


def plan_renders(
    request: Request,
    path: OutputPath | None,
    color: str | None,
    with_products: bool,
    session: Session,
    unwritten: Unwritten,
    log: SceneLog,
) -> list[Render]:
    """The renders, the command's own image first. Says what is wrong with products."""
    facts = {}
    if request.settings:
        facts["hdtrapeze/renderSettings"] = str(request.settings.GetPath())
    if request.render_pass:
        facts["hdtrapeze/renderPass"] = str(request.render_pass.GetPath())
    own = Output(request.options, path, color=color, metadata=facts)
    renders = [Render(replace(request.options), request.camera, [own])]
    if not (request.settings and with_products):
        return renders
    image = image_values(request.settings, log, fallbacks=True)
    camera = settings_camera(request.settings, log) or request.camera
    for product in read_products(request.settings, unwritten, log):
        aovs, render_vars = _aovs(product, session, log)
        if not aovs:
            unwritten.refused.append(product.path)
            continue
        options = request.product_options(image, product.values)
        options.aovs = aovs
        try:
            options.data_window(options.width, options.height)
        except SceneError as error:
            log.warn(product.path, "data-window", f"{error} Not written")
            unwritten.refused.append(product.path)
            continue
        output = Output(options, None, product, render_vars)
        output.metadata = facts | {"hdtrapeze/renderProduct": product.path}
        through = product.camera or camera
        for render in renders:
            if render.agrees(options, through):
                render.add(output, aovs)
                break
        else:
            renders.append(Render(replace(options), through, [output]))
    return renders


def files_of_frame(
    renders: list[Render],
    frame: float | None,
    written: dict[str, str],
    unwritten: Unwritten,
    log: SceneLog,
) -> list[list[tuple[Output, str]]]:
    """Files of each render at a frame.

    `written` holds the files of earlier frames and who wrote them. Of several that would write
    one file, the first product does.
    """
    taken: dict[str, str] = {}
    files: list[list[tuple[Output, str]]] = [[] for _ in renders]
    entries = [(i, output) for i, render in enumerate(renders) for output in render.outputs]
    # The products first: what they hold is more than the command's own colour.
    for i, output in sorted(entries, key=lambda entry: entry[1].product is None):
        try:
            path = output.at(frame, log)
        except OutputError as error:
            log.warn(output.owner, "product-file", f"{error} Not written")
            unwritten.failed.append(output.owner)
            continue
        if path is None:
            unwritten.refused.append(output.owner)
            continue
        place = _place(path)
        if place in taken:
            who = taken[place]
            text = f"{path} is already written by {who}"
            other = f"not by {output.owner}" if output.product else "not by the command"
            log.warn(output.owner, "product-file", f"{text}, and {other}")
            unwritten.refused.append(output.owner)
            continue
        if output.product and written.get(place) == output.owner:
            text = f"each frame replaces {path}: put the frame into productName, as #### or <F4>"
            log.warn(output.owner, "product-name", text)
        taken[place] = output.owner
        files[i].append((output, path))
    written.update(taken)
    return files


def _place(path: str) -> str:
    return os.path.realpath(path)


def _path(camera: UsdGeom.Camera | None) -> str:
    return str(camera.GetPath()) if camera else ""


def _shared(options: Options) -> Options:
    """The options without what concerns a file only."""
    return replace(options, aovs=[], camera=None, compression="zip", pixel_type="half")


def _aovs(product: Product, session: Session, log: SceneLog) -> tuple[list[str], list[RenderVar]]:
    """AOVs that a product needs, and its vars that can be written."""
    relationship = product.prim.GetOrderedVarsRel()
    if not relationship.GetTargets():
        log.warn(product.path, "product-vars", "its orderedVars is empty; color is written")
        return ["color"], []
    found = [(session.render_var_aov(var), var) for var in product.vars]
    found = [(aov, var) for aov, var in found if aov]
    if not found:
        log.warn(product.path, "product-vars", "none of its vars can be written; not written")
    return list(dict.fromkeys(aov for aov, _ in found)), [var for _, var in found]
