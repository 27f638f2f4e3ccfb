"""`hdtrapeze record`: a USD file in, one image a frame out, and the stage's render products.

Everything that can be checked is checked before the first ray: flags, the stage, the camera, the
output's folder and format. A frame is written under its name only once it is complete.
"""

import resource
import sys
from dataclasses import dataclass, field
from pathlib import Path

from pxr import Usd

from .errors import HdTrapezeError, Interrupted, NativeError, OutputError, SceneError
from .frames import OutputPath, parse_frames
from .log import FALLBACK, SceneLog, logger
from .outputs import Output, check_writable, metadata, own_kind
from .plan import Planner, Render
from .progress import ProgressBar
from .render import Renderer
from .request import check_flags, make_request
from .stage import Diagnostics, open_stage
from .tracefile import Trace
from .unwritten import Unwritten


def record(args) -> None:
    """Runs the command with parsed arguments; raises HdTrapezeError."""
    trace = Trace()
    if args.traceToFile:
        check_writable(Path(args.traceToFile))
    try:
        with trace.span("record"):
            _record(args, trace)
    finally:
        if args.traceToFile:
            trace.write(args.traceToFile, args.traceFormat)


@dataclass
class _Command:
    """One run of the command."""

    args: object
    trace: Trace
    log: SceneLog
    diagnostics: Diagnostics
    stage: Usd.Stage
    output: OutputPath
    planner: Planner
    unwritten: Unwritten = field(default_factory=Unwritten)


def _record(args, trace: Trace) -> None:
    output = OutputPath(args.outputImagePath)
    own_kind(output, bool(args.aov))
    frames, decimals = parse_frames(args.frames) if args.frames else (None, 0)
    output.check(frames, decimals)
    check_flags(args)
    log = SceneLog()
    diagnostics = Diagnostics(log)
    with trace.span("open stage"):
        stage = open_stage(
            args.usdFilePath, args.mask, args.sessionLayer, args.resolverContext, log
        )
        diagnostics.report(stage)
    _stop_at_warnings(args, log)
    request = make_request(args, stage, log)
    camera = request.camera
    if frames is None:
        frames = [None if args.defaultTime else stage.GetStartTimeCode()]
    if not args.quiet:
        print(f"Camera: {camera.GetPath() if camera else 'none, framing the bounds'}", flush=True)
    unwritten = Unwritten()
    planner = Planner(request, not args.no_products, unwritten, log)
    command = _Command(args, trace, log, diagnostics, stage, output, planner, unwritten)
    with Renderer(request.options, log, request.render_pass) as renderer:
        diagnostics.report()
        _stop_at_warnings(args, log)
        _record_frames(command, renderer, frames)
    if args.memstats:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        unit = 1 if sys.platform == "darwin" else 1024
        print(f"Peak memory: {peak * unit / 2**20:.0f} MiB")
    fallback = _fallback(log) if request.options.backend == "gpu" else None
    if error := command.unwritten.error() or fallback:
        raise error


def _fallback(log: SceneLog) -> SceneError | None:
    """What the command ends with, once all is written, where the CPU rendered for the GPU."""
    why = [text for _, code, text in log.warnings if code == FALLBACK]
    if not why:
        return None
    return SceneError(f"The GPU did not render all that it was asked for: {why[0]}.")


def _record_frames(command: _Command, renderer: Renderer, frames: list[float | None]) -> None:
    """Renders every frame; one that fails does not keep the others from being rendered."""
    failed: list[HdTrapezeError] = []
    for frame in frames:
        command.log.frame = frame
        try:
            details = {"frame": "default" if frame is None else frame}
            with command.trace.span("frame", **details) as details:
                _record_frame(command, renderer, frame, details)
        except (SceneError, OutputError) as error:
            if frame is not None:
                error.args = (f"Frame {frame:g}: {error}",)
            if command.args.abortOnError or len(frames) == 1:
                raise
            logger.error("%s", error)
            failed.append(error)
        finally:
            command.diagnostics.report()
    if failed:
        raise type(failed[0])(*_failures(failed, len(frames)))


def _failures(failed: list[HdTrapezeError], count: int) -> tuple:
    text = f"{len(failed)} of {count} frames failed."
    first = failed[0]
    return (first.code, first.name, text) if isinstance(first, NativeError) else (text,)


def _stop_at_warnings(args, log: SceneLog) -> None:
    if args.abortOnError and log.warnings:
        raise SceneError("Stopped at the first warning about the scene (--abortOnError).")


def _record_frame(command, renderer, frame, details) -> None:
    """All renders of one frame."""
    path = command.output.path if frame is None else command.output.at(frame)
    plan = command.planner.plan(renderer, frame, path, command.args.colorCorrectionMode)
    command.diagnostics.report()
    _stop_at_warnings(command.args, command.log)
    details["seconds"], failure = 0.0, None
    for render in plan.renders:
        renderer.options = render.options
        try:
            with command.trace.span("read stage"):
                renderer.load(command.stage, frame, render.camera)
                command.diagnostics.report()
            several = len(plan.renders) > 1
            details["seconds"] += _render(command, renderer, frame, render, several)
        except (SceneError, OutputError) as error:
            if command.args.abortOnError:
                raise
            _lose_products(command, render, error)
            if render is plan.own:
                failure = error
    if failure:
        raise failure


def _lose_products(command: _Command, render: Render, error: HdTrapezeError) -> None:
    """Tells of the products whose render failed. The others are still rendered."""
    for output in render.outputs:
        if output.owner and isinstance(error, SceneError):
            text = f"{str(error).removesuffix('.')}; it is not written"
            command.log.warn(output.owner, "product-render", text)
            command.unwritten.refused.append(output.owner)


def _render(command, renderer, frame, render: Render, several: bool) -> float:
    """Renders and writes what was loaded; gives the seconds that it took."""
    args, trace, outputs = command.args, command.trace, render.outputs
    if args.abortOnError or args.explain:
        with trace.span("commit"):
            renderer.commit()
    _stop_at_warnings(args, command.log)
    if args.explain:
        if several:
            print(f"{', '.join(output.path for output in outputs)}:")
        print(renderer.explain())
    interrupted = None
    name = Path(outputs[0].path).name
    with trace.span("render") as phase, ProgressBar(name, args.quiet) as bar:
        try:
            renderer.render(bar)
        except Interrupted as error:
            interrupted = error
    statistics = renderer.statistics()
    phase.update(statistics)
    with trace.span("write"):
        facts = metadata(renderer, args.usdFilePath, frame)
        if interrupted:
            _write_partial(renderer, interrupted, outputs, facts)
            raise interrupted
        for output in outputs:
            _write(command, renderer, output, facts)
    _print_statistics(args, renderer, frame, outputs, statistics)
    return statistics["total_seconds"]


def _write(command, renderer, output: Output, facts: dict[str, str]) -> None:
    """Writes a file. Where a product's cannot be written, the others still are."""
    try:
        output.write(renderer, facts)
    except OutputError as error:
        if not output.owner:
            raise
        command.log.warn(output.owner, "product-file", str(error))
        command.unwritten.failed.append(output.owner)


def _write_partial(renderer, interrupted, outputs, facts: dict[str, str]) -> None:
    """Keeps what an interrupted render had, beside the places of the complete frames."""
    if renderer.session.progress().samples_done == 0:
        interrupted.args = ("Interrupted before there was anything to keep.",)
        return
    try:
        kept = [output.write_partial(renderer, facts) for output in outputs]
        interrupted.args = (f"Interrupted. What was rendered is in {', '.join(kept)}.",)
    except (NativeError, OutputError) as error:
        interrupted.args = (f"Interrupted. What was rendered could not be kept: {error}",)


def _print_statistics(args, renderer, frame, outputs, statistics) -> None:
    if not args.quiet:
        width, height = renderer.resolution
        at = "default time" if frame is None else f"frame {frame:g}"
        x0, y0, x1, y1 = renderer.options.data_window(width, height)
        size = f"{width} x {height}"
        if (x0, y0, x1, y1) not in ((0, 0, 0, 0), (0, 0, width, height)):
            size += f" (data window {x1 - x0} x {y1 - y0} at {x0}, {y0})"
        for output in outputs:
            print(
                f"{output.path}: {at}, {size}, {renderer.options.samples} samples, "
                f"{statistics['total_seconds']:.2f} s",
                flush=True,
            )
    if args.verbose:
        for key, value in statistics.items():
            print(
                f"    {key}: {value:,.6g}" if isinstance(value, float) else f"    {key}: {value:,}"
            )
    if args.memstats:
        sizes = {k: v for k, v in statistics.items() if k.endswith("_bytes")}
        for key, value in sizes.items():
            print(f"    {key.replace('_', ' ')}: {value / 2**20:.1f} MiB")
