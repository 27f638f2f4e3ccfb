"""`hdtrapeze dump`: the scene as the renderer understands it, as text that does not change.

Prims by path with their resolved motion, instances, camera and settings: what a golden test
compares, and what to look at when a render shows something else than was meant.
"""

import os
import sys
import tempfile
from pathlib import Path

from .errors import OutputError
from .frames import parse_frames
from .log import SceneLog
from .render import Renderer
from .request import check_flags, make_request
from .stage import Diagnostics, open_stage


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
        for frame in frames:
            renderer.load(stage, frame, request.camera)
            diagnostics.report()
            name = "default time" if frame is None else f"frame {frame:.10g}"
            texts.append(f"{name}\n{renderer.session.dump()}")
    _write("\n".join(texts), args.output)


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
