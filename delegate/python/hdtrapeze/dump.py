"""`hdtrapeze dump`: the scene as the renderer understands it, as text that does not change.

Prims by path with their resolved motion, instances, camera, settings and render products: what a
golden test compares, and what to look at when a render shows something else than was meant.
"""

import os
import sys
import tempfile
from pathlib import Path

from .errors import OutputError
from .frames import expand_frame, parse_frames
from .log import SceneLog
from .plan import Render, plan_renders
from .render import Renderer
from .request import Request, check_flags, make_request
from .session import Session
from .stage import Diagnostics, open_stage
from .unwritten import Unwritten


def dump(args) -> None:
    """Runs the command with parsed arguments; raises HdTrapezeError."""
    frames = parse_frames(args.frames)[0] if args.frames else None
    check_flags(args)
    log = SceneLog()
    diagnostics = Diagnostics(log)
    stage = open_stage(args.usdFilePath, args.mask, args.sessionLayer, args.resolverContext, log)
    diagnostics.report(stage)
    request = make_request(args, stage, log)
    if frames is None:
        frames = [None if args.defaultTime else stage.GetStartTimeCode()]
    texts = []
    with Renderer(request.options, log, request.render_pass) as renderer:
        renders = plan_renders(
            request, None, None, not args.no_products, renderer.session, Unwritten(), log
        )
        asked = _request(request)
        for frame in frames:
            renderer.load(stage, frame, request.camera)
            diagnostics.report()
            name = "default time" if frame is None else f"frame {frame:.10g}"
            written = _products(renders, frame, renderer.session)
            texts.append(f"{name}\n{renderer.session.dump()}\n{asked}{written}")
    _write("\n".join(texts), args.output)


def _request(request: Request) -> str:
    """Purposes, and the prims that say what is rendered."""
    purposes = dict.fromkeys(["default", *request.options.purposes])
    lines = [f"purposes {' '.join(purposes)}"]
    if request.render_pass:
        lines.append(f"render pass {request.render_pass.GetPath()}")
    if request.settings:
        lines.append(f"render settings {request.settings.GetPath()}")
    return "".join(f"{line}\n" for line in lines)


def _products(renders: list[Render], frame: float | None, session: Session) -> str:
    """Render products that a command would write: their files, cameras, sizes and vars."""
    lines = []
    entries = ((r, output) for r in renders for output in r.outputs if output.product)
    for render, output in sorted(entries, key=lambda entry: entry[1].owner):
        options = render.options
        height = "by the camera" if options.height is None else options.height
        lines += [
            f"product {output.owner}",
            f"  file {expand_frame(output.product.name_at(frame), frame) or 'none'}",
            f"  camera {render.camera.GetPath() if render.camera else 'framing the bounds'}",
            f"  resolution {options.width} {height}, samples {options.samples}",
        ]
        found = [f"{var.path}: {session.render_var_aov(var)}" for var in output.vars]
        lines += [f"  var {text}" for text in found or output.options.aovs]
    return "".join(f"{line}\n" for line in lines)


def _write(text: str, output: str | None) -> None:
    """To a file that appears whole, or to stdout."""
    if output is None:
        sys.stdout.write(text)
        return
    path = Path(output)
    try:
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(beside).replace(path)
    except OSError as error:
        raise OutputError(f"{output} cannot be written: {error.strerror}.") from None
