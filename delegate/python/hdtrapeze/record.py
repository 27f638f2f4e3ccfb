"""`hdtrapeze record`: a USD file in, one image a frame out.

Everything that can be checked is checked before the first ray: flags, the stage, the camera, the
output's folder and format. A frame is written under its name only once it is complete.
"""

import difflib
import json
import os
import resource
import signal
import sys
from contextlib import suppress
from pathlib import Path

from pxr import UsdRender

from .camera import find_camera
from .errors import Interrupted, NativeError, OutputError, SceneError, UsageError
from .flags import COMPLEXITIES
from .frames import OutputPath, parse_frames
from .log import SceneLog
from .native import version
from .options import AOVS, Options
from .progress import ProgressBar
from .render import Renderer
from .stage import Diagnostics, open_stage
from .tracefile import Trace
from .usdrender import RENDERER_NAMES, find_render_pass, find_render_settings

FORMATS = {".exr": "EXR", ".png": "PNG"}

CONFORM_POLICIES = {
    "expandAperture": "fit",
    "cropAperture": "crop",
    "adjustApertureWidth": "matchVertically",
    "adjustApertureHeight": "matchHorizontally",
    "adjustPixelAspectRatio": "dontConform",
}
"""UsdRenderSettings' aspectRatioConformPolicy as window policies."""


class _Terminated(KeyboardInterrupt):
    terminated = True


def record(args) -> None:
    """Runs the command with parsed arguments; raises HdTrapezeError."""
    trace = Trace()
    if args.traceToFile:
        _check_writable(Path(args.traceToFile))
    with suppress(ValueError):  # not in the main thread: signals are someone else's

        def terminate(*_):
            raise _Terminated

        signal.signal(signal.SIGTERM, terminate)
    try:
        with trace.span("record"):
            _record(args, trace)
    finally:
        if args.traceToFile:
            trace.write(args.traceToFile, args.traceFormat)


def _record(args, trace: Trace) -> None:
    output = OutputPath(args.outputImagePath)
    kind = _output_kind(args, output)
    frames, decimals = parse_frames(args.frames) if args.frames else (None, 0)
    output.check(frames, decimals)
    options = make_options(args)
    options.validate()
    log = SceneLog()
    diagnostics = Diagnostics(log)
    with trace.span("open stage"):
        stage = open_stage(
            args.usdFilePath, args.mask, args.sessionLayer, args.resolverContext, log
        )
        diagnostics.report(stage)
    _stop_at_warnings(args, log)
    render_pass = find_render_pass(stage, args.renderPassPrimPath, args.renderer is not None, log)
    settings = find_render_settings(stage, args.renderSettingsPrimPath, render_pass, log)
    if settings:
        named = bool(args.renderSettingsPrimPath or args.renderPassPrimPath)
        apply_render_settings(options, settings, args, named, log)
        options.validate()
    camera = find_camera(stage, options.camera, settings, log)
    if frames is None:
        frames = [None if args.defaultTime else stage.GetStartTimeCode()]
    if not args.quiet:
        print(f"Camera: {camera.GetPath() if camera else 'none, framing the bounds'}", flush=True)
    with Renderer(options, log, render_pass) as renderer:
        for frame in frames:
            path = output.at(frame) if frame is not None else output.path
            details = {"frame": "default" if frame is None else frame}
            try:
                with trace.span("frame", **details) as details:
                    with trace.span("read stage"):
                        renderer.load(stage, frame, camera, settings)
                        diagnostics.report()
                    _record_frame(renderer, frame, path, kind, args, trace, details)
            except (SceneError, OutputError) as error:
                if frame is not None:
                    error.args = (f"Frame {frame:g}: {error}",)
                raise
            finally:
                diagnostics.report()
    if args.memstats:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        unit = 1 if sys.platform == "darwin" else 1024
        print(f"Peak memory: {peak * unit / 2**20:.0f} MiB")


def _stop_at_warnings(args, log: SceneLog) -> None:
    if args.abortOnError and log.warnings:
        raise SceneError("Stopped at the first warning about the scene (--abortOnError).")


def _record_frame(renderer, frame, path, kind, args, trace, details) -> None:
    """Renders and writes the frame that was loaded."""
    if args.abortOnError or args.explain:
        with trace.span("commit"):
            renderer.commit()
    _stop_at_warnings(args, renderer.log)
    if args.explain:
        print(renderer.explain())
    name = Path(path).name
    interrupted = None
    with trace.span("render") as phase, ProgressBar(name, args.quiet) as bar:
        try:
            renderer.render(bar)
        except Interrupted as error:
            interrupted = error
    statistics = renderer.statistics()
    phase.update(statistics)
    details.update(seconds=statistics["total_seconds"])
    with trace.span("write"):
        if interrupted:
            _write_partial(renderer, interrupted, path, kind, args, frame)
            raise interrupted
        write(renderer, path, kind, args, frame, complete=True)
    if not args.quiet:
        width, height = renderer.resolution
        at = "default time" if frame is None else f"frame {frame:g}"
        print(
            f"{path}: {at}, {width} x {height}, {renderer.options.samples} samples, "
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


def _write_partial(renderer, interrupted, path, kind, args, frame) -> None:
    """Keeps what an interrupted render had, beside the place of the complete frame."""
    target = Path(path)
    partial = str(target.with_name(f"{target.stem}.partial{target.suffix}"))
    if renderer.session.progress().samples_done == 0:
        interrupted.args = ("Interrupted before there was anything to keep.",)
        return
    try:
        write(renderer, partial, kind, args, frame, complete=False)
        interrupted.args = (f"Interrupted. What was rendered is in {partial}.",)
    except (NativeError, OutputError) as error:
        interrupted.args = (f"Interrupted. What was rendered could not be kept: {error}",)


def write(renderer, path: str, kind: str, args, frame: float | None, complete: bool) -> None:
    """Writes the last render to a file, with metadata in an EXR."""
    color = args.colorCorrectionMode or ("sRGB" if kind == "PNG" else "disabled")
    try:
        renderer.session.write_image(
            path,
            kind,
            renderer.options.aovs if kind == "EXR" else ["color"],
            metadata(renderer, args, frame, complete) if kind == "EXR" else {},
            pixel_type="FLOAT" if args.float else "HALF",
            compression=args.compression.upper(),
            color="SRGB" if color == "sRGB" else "LINEAR",
        )
    except NativeError as error:
        raise OutputError(f"{path} cannot be written: {error}") from None


def metadata(renderer, args, frame: float | None, complete: bool) -> dict[str, str]:
    """What an EXR says about its making, besides what the renderer adds (samples, shutter...)."""
    options = vars(renderer.options)
    statistics = renderer.statistics()
    timings = {k: round(v, 6) for k, v in statistics.items() if k.endswith("_seconds")}
    state = renderer.camera
    return {
        "hdtrapeze/version": version(),
        "hdtrapeze/stage": str(Path(args.usdFilePath).resolve()),
        "hdtrapeze/camera": state.path or "framing the bounds",
        "hdtrapeze/frame": "default" if frame is None else f"{frame:.10g}",
        "hdtrapeze/settings": json.dumps(options),
        "hdtrapeze/timings": json.dumps(timings),
        "hdtrapeze/complete": "true" if complete else "false",
    }


def make_options(args) -> Options:
    """Options of parsed flags; raises UsageError for what cannot be."""
    if args.renderSettingsPrimPath and args.renderPassPrimPath:
        raise UsageError(
            "Only one of --renderSettingsPrimPath and --renderPassPrimPath may be given."
        )
    if args.renderer is not None and args.renderer.lower() not in RENDERER_NAMES:
        raise UsageError(
            f"--renderer {args.renderer}: this command has one renderer, Trapeze. "
            f"Other delegates are for usdrecord."
        )
    if args.colorCorrectionMode == "openColorIO":
        raise UsageError(
            "--colorCorrectionMode openColorIO is not supported yet: write an EXR, which is "
            "linear, and convert that."
        )
    if args.disableGpu and args.backend == "gpu":
        raise UsageError("--disableGpu and --backend gpu contradict each other.")
    for name in args.aov:
        if name not in AOVS:
            near = difflib.get_close_matches(name, AOVS, 1, 0.5)
            hint = f"Did you mean {near[0]}?" if near else f"Known are {', '.join(AOVS)}."
            raise UsageError(f"--aov: there is no AOV {name}. {hint}")
    aovs = ["color", *args.aov]
    return Options(
        width=960 if args.imageWidth is None else args.imageWidth,
        samples=args.samples,
        shading_rate=args.shading_rate * COMPLEXITIES[args.complexity],
        shutter=tuple(args.shutter) if args.shutter else None,
        motion_blur=not args.no_motion_blur,
        defocus=not args.no_defocus,
        aovs=list(dict.fromkeys(aovs)),
        filter=args.filter,
        filter_width=args.filter_width,
        seed=args.seed,
        threads=args.threads,
        crop=tuple(args.crop) if args.crop else None,
        backend="cpu" if args.disableGpu else args.backend,
        camera=args.camera,
        purposes=args.purposes.replace(",", " ").split(),
        camera_light=not args.disableCameraLight,
        draw_modes=not args.disableDrawMode,
    )


def apply_render_settings(
    options: Options, settings: UsdRender.Settings, args, named: bool, log: SceneLog
) -> None:
    """Takes what a RenderSettings prim says, where no flag says otherwise.

    The resolution only from a prim that the command names: usdrecord's image has its own width.
    """
    if settings.GetDisableMotionBlurAttr().Get():
        options.motion_blur = False
    if settings.GetDisableDepthOfFieldAttr().Get():
        options.defocus = False
    if not named:
        return
    if args.imageWidth is None and settings.GetResolutionAttr().HasAuthoredValue():
        options.width, options.height = settings.GetResolutionAttr().Get()
        policy = settings.GetAspectRatioConformPolicyAttr().Get()
        options.window_policy = CONFORM_POLICIES.get(policy, options.window_policy)
        options.pixel_aspect = settings.GetPixelAspectRatioAttr().Get()
    if settings.GetProductsRel().GetTargets():
        text = "render products are not written yet: the output named on the command line is"
        log.warn(settings.GetPath(), "unsupported-products", text)


def _output_kind(args, output: OutputPath) -> str:
    """EXR or PNG; raises where the output cannot be written."""
    path = Path(output.path)
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise UsageError(
            f"{output.path}: the output must end in .exr or .png"
            + (f", not {path.suffix}." if path.suffix else ".")
        )
    if kind == "PNG" and args.aov:
        raise UsageError("A PNG holds only color: write an .exr for --aov.")
    _check_writable(path)
    return kind


def _check_writable(path: Path) -> None:
    """Raises OutputError where no file can be written at `path`."""
    folder = path.parent
    try:
        found, taken = folder.is_dir(), path.is_dir()
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from None
    if not found:
        raise OutputError(f"The folder {folder} does not exist.")
    if taken:
        raise OutputError(f"{path} is a folder.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"The folder {folder} is not writable.")
