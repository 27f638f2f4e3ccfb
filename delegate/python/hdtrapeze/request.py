"""What a command asks for: its flags, with what the stage's render settings say.

Who decides, first to last:

* the command's own image: flags; then the settings prim (--renderSettingsPrimPath, the source of
  --renderPassPrimPath, else the stage's renderSettingsPrimPath), whose resolution, pixel aspect,
  conform policy and data window count only where the command names the prim and no --imageWidth;
  then usdrecord's defaults.
* products: flags except --camera and --imageWidth; then what the product authors; then the
  settings prim with its fallbacks.
"""

import difflib
from dataclasses import dataclass, field

from pxr import Sdf, Usd, UsdGeom, UsdRender

from .camera import find_camera
from .errors import UsageError
from .flags import COMPLEXITIES
from .log import SceneLog
from .named import settings as own_settings
from .options import AOVS, Options
from .primvars import AOV_PREFIX
from .settings import Shape, check_unused, effect_values, purpose_values, read_shape
from .usdrender import RENDERER_NAMES, find_render_pass, find_render_settings


@dataclass
class Request:
    """The command's own image, and what products start from."""

    options: Options
    camera: UsdGeom.Camera | None
    """None: the bounds are framed."""
    render_pass: UsdRender.Pass | None = None
    settings: UsdRender.Settings | None = None
    flags: dict = field(default_factory=dict)
    """Fields of Options that the command line sets."""
    complexity: float = 1.0
    scene: dict = field(default_factory=dict)
    """Fields of Options that the settings prim sets for every image."""
    shape: Shape | None = None
    """What the settings prim says of the image's shape."""
    takes_shape: bool = False
    """The command's own image has that shape..."""
    takes_window: bool = False
    """...and that data window."""

    def product_options(self, values: dict) -> Options:
        """Options of a product, which overrides some; but for the image's shape."""
        own = {k: v for k, v in self.flags.items() if k not in ("width", "camera", "aovs")}
        return combine(self.scene, values, own, complexity=self.complexity)


def combine(*layers: dict, complexity: float = 1.0) -> Options:
    """Options of which later layers override earlier ones."""
    values: dict = {}
    for layer in layers:
        values |= layer
    options = Options(**values)
    rate, least = options.shading_rate, own_settings()["shadingRate"].least
    # As fine as can be, where the complexity asks for more; what cannot be stays so.
    options.shading_rate = max(rate * complexity, min(rate, least))
    return options


def make_request(args, stage: Usd.Stage, log: SceneLog) -> Request:
    """Finds pass, settings and camera; raises HdTrapezeError where the command cannot be done."""
    flags = flag_values(args)
    render_pass = find_render_pass(stage, args.renderPassPrimPath, args.renderer is not None, log)
    settings = find_render_settings(stage, args.renderSettingsPrimPath, render_pass, log)
    named = bool(args.renderSettingsPrimPath or args.renderPassPrimPath)
    scene, shape, has_resolution = {}, None, False
    if settings:
        check_unused(settings, log)
        scene = effect_values(settings, log) | purpose_values(settings, log)
        if named or not args.no_products:
            shape = read_shape(settings, log)
        has_resolution = settings.GetResolutionAttr().HasAuthoredValue()
    complexity = COMPLEXITIES[args.complexity]
    options = combine(scene, flags, complexity=complexity)
    options.validate()
    camera = find_camera(stage, options.camera, settings, log)
    return Request(
        options,
        camera,
        render_pass,
        settings,
        flags,
        complexity,
        scene,
        shape,
        takes_shape=bool(settings) and named and has_resolution and "width" not in flags,
        takes_window=bool(settings) and named and not options.is_windowed,
    )


def check_flags(args) -> None:
    """Raises UsageError for flags that cannot be; needs no stage."""
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
    combine(flag_values(args), complexity=COMPLEXITIES[args.complexity]).validate()


def flag_values(args) -> dict:
    """Fields of Options that flags set; what is not given is not there."""
    values = {
        "width": args.imageWidth,
        "camera": args.camera,
        "samples": args.samples,
        "shading_rate": args.shading_rate,
        "curves": args.curves,
        "cull": args.cull,
        "shutter": tuple(args.shutter) if args.shutter else None,
        "filter": args.filter,
        "filter_width": args.filter_width,
        "seed": args.seed,
        "threads": args.threads,
        "crop": tuple(args.crop) if args.crop else None,
        "overscan": args.overscan,
        "backend": "cpu" if args.disableGpu else args.backend,
        "compression": args.compression,
        "pixel_type": "float" if args.float else "half" if args.half else None,
    }
    values = {name: value for name, value in values.items() if value is not None}
    if args.purposes is not None:
        values["purposes"] = args.purposes.replace(",", " ").split()
    for off, name in (
        (args.no_motion_blur, "motion_blur"),
        (args.no_defocus, "defocus"),
        (args.no_occlusion_culling, "occlusion_culling"),
        (args.disableCameraLight, "camera_light"),
        (args.disableDrawMode, "draw_modes"),
    ):
        if off:
            values[name] = False
    values["aovs"] = list(dict.fromkeys(["color", *map(_known_aov, args.aov)]))
    return values


def _known_aov(name: str) -> str:
    primvar = name.removeprefix(AOV_PREFIX)
    if name in AOVS or (primvar != name and Sdf.Path.IsValidNamespacedIdentifier(primvar)):
        return name
    near = difflib.get_close_matches(name, AOVS, 1, 0.5)
    hint = f"Did you mean {near[0]}?" if near else f"Known are {', '.join(AOVS)} and primvars:NAME."
    raise UsageError(f"--aov: there is no AOV {name}. {hint}")
