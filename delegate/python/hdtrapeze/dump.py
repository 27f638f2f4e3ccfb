"""`hdtrapeze dump`: the scene as the renderer understands it, as text that does not change.

Prims by path with their resolved motion, instances, camera, settings and render products: what a
golden test compares, and what to look at when a render shows something else than was meant.
"""

import os
import sys
import tempfile
from pathlib import Path

from .errors import OutputError, SceneError
from .frames import parse_frames
from .log import SceneLog
from .options import Options
from .plan import FramePlan, Planner
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
        planner = Planner(request, not args.no_products, Unwritten(), log)
        asked = _request(request)
        for frame in frames:
            plan = planner.plan(renderer, frame)
            own = plan.own
            if own is None:
                raise SceneError("The image cannot be rendered as asked.")
            renderer.options = own.options
            renderer.load(stage, frame, request.camera)
            diagnostics.report()
            name = "default time" if frame is None else f"frame {frame:.10g}"
            written = _products(plan, renderer.session)
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


def _products(plan: FramePlan, session: Session) -> str:
    """Render products that a command would write: files, cameras, images, effects and vars."""
    told = {
        owner: [f"product {owner}", f"  file none: {why}"] for owner, why in plan.refused.items()
    }
    entries = [(r, output) for r in plan.renders for output in r.outputs if output.owner]
    for render, output in entries:
        options = render.options
        lines = [
            f"product {output.owner}",
            f"  file {output.path}",
            f"  camera {render.camera.GetPath() if render.camera else 'framing the bounds'}",
            f"  resolution {options.width} {options.height}, samples {options.samples}",
            f"  window policy {options.window_policy}, pixel aspect {options.pixel_aspect:.6g}",
            f"  data window {_window(options)}",
            f"  motion blur {_switch(options.motion_blur)}, defocus {_switch(options.defocus)}",
        ]
        found = [f"{var.path}: {session.render_var_aov(var)}" for var in output.vars]
        told[output.owner] = lines + [f"  var {text}" for text in found or output.options.aovs]
    return "".join(f"{line}\n" for owner in sorted(told) for line in told[owner])


def _window(options: Options) -> str:
    """In pixels, x0 y0 x1 y1."""
    window = options.data_window(options.width, options.height)
    return " ".join(map(str, window)) if any(window) else "whole"


def _switch(on: bool) -> str:
    return "on" if on else "off"


def _write(text: str, output: str | None) -> None:
    """To a file that appears whole, or to stdout."""
    if output is None:
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            # What is left would be tried again, and fail again, as the process ends.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise OutputError(f"The text cannot be written: {error.strerror}.") from None
        return
    path = Path(output)
    try:
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(beside).replace(path)
    except OSError as error:
        raise OutputError(f"{output} cannot be written: {error.strerror}.") from None
