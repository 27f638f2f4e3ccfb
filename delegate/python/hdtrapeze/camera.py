"""Which camera renders, and what it looks like in scene units.

The choice is usdrecord's: the camera that was asked for, else the render settings' camera, else
the first prim with the primary camera's name, else a camera that frames the stage's bounds.
UsdGeomCamera gives apertures and focal length in tenths of scene units, focusDistance in units.
Blades, shutter curve and changing lenses are read by `lens`.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender, UsdUtils

from .endless import endless_instancers
from .errors import SceneError, UsageError
from .guard import FAULTS, quiet
from .lens import (
    APERTURE_UNIT,
    Aperture,
    ShutterCurve,
    read_aperture,
    read_lens,
    read_lens_samples,
    read_shutter_curve,
)
from .log import SceneLog
from .prototypes import find_all
from .shutter import Shutter
from .targets import prim_at, targets_of
from .transforms import Level, TransformReader, static_level
from .typed import get_or_fallback, get_or_ignore, token

PROJECTIONS = ("perspective", "orthographic")

LARGEST_FILM = 1e17
"""Scene units: a film back of this size gives no view that can be computed."""

LARGEST_BOUND = 1e12
"""Scene units: a prim that reaches farther from the origin is left out of the framing."""


DEFAULT_ASPECT = Gf.Camera().aspectRatio


@dataclass
class CameraState:
    """A camera at one frame, in scene units; shutter in time codes relative to the frame."""

    path: str
    levels: list[Level]
    projection: str
    horizontal_aperture: float
    vertical_aperture: float
    horizontal_aperture_offset: float
    vertical_aperture_offset: float
    focal_length: float
    focus_distance: float
    f_stop: float
    clipping: tuple[float, float]
    shutter: tuple[float, float]
    exposure_scale: float
    aperture: Aperture = field(default_factory=Aperture)
    shutter_curve: ShutterCurve = field(default_factory=ShutterCurve)
    clipping_planes: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    lens_samples: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    """Times relative to the frame, and the numbers above at each; none: they do not change."""

    aspect: float = DEFAULT_ASPECT
    """Width over height of the film back at the frame's own time: it shapes the image, which must
    not depend on the shutter."""


def find_camera(
    stage: Usd.Stage, wanted: str | None, settings: UsdRender.Settings | None, log: SceneLog
) -> UsdGeom.Camera | None:
    """The camera to render, or None: frame the bounds. `wanted` is a path or a prim's name."""
    if wanted:
        return named_camera(stage, wanted)
    if settings:
        camera = settings_camera(settings, log)
        if camera:
            return camera
    try:
        return named_camera(stage, UsdUtils.GetPrimaryCameraName())
    except SceneError:
        return None


def settings_camera(settings: UsdRender.Settings, log: SceneLog) -> UsdGeom.Camera | None:
    """The camera of a settings prim, or None."""
    targets = targets_of(settings.GetCameraRel(), log, one=True)
    if not targets:
        return None
    camera = UsdGeom.Camera(prim_at(settings.GetPrim().GetStage(), targets[0]))
    if camera:
        return camera
    log.warn(settings.GetPath(), "camera", f"its camera {targets[0]} is none; ignored")
    return None


def named_camera(stage: Usd.Stage, wanted: str) -> UsdGeom.Camera:
    """The camera at a path, or the first one with a name or whose path ends so."""
    if not Sdf.Path.IsValidPathString(wanted):
        raise UsageError(f"--camera: {wanted!r} is neither the path nor the name of a prim.")
    path = Sdf.Path(wanted)
    if path.IsAbsolutePath():
        prim = stage.GetPrimAtPath(path)
        if not prim:
            raise SceneError(f"There is no camera at {wanted}: no such prim.")
        camera = UsdGeom.Camera(prim)
        if not camera:
            kind = prim.GetTypeName() or "prim without a type"
            raise SceneError(f"There is no camera at {wanted}: it is a {kind}.")
        return camera
    end = f"/{path.GetPrimPath()}"
    for prim in find_all(stage, UsdGeom.Camera, Usd.PrimDefaultPredicate):
        if str(prim.GetPath()).endswith(end):
            return UsdGeom.Camera(prim)
    what = "has a path that ends in" if path.pathElementCount > 1 else "is named"
    raise SceneError(f"No camera of this stage {what} {wanted}.")


def authored_shutter(
    camera: UsdGeom.Camera | None, frame: float | None, log: SceneLog
) -> tuple[float, float]:
    """The camera's shutter:open and shutter:close at the frame; zero without a camera."""
    if not camera or frame is None:
        return 0.0, 0.0
    time = Usd.TimeCode(frame)
    ends = (camera.GetShutterOpenAttr(), camera.GetShutterCloseAttr())
    return tuple(float(get_or_fallback(attribute, time, log)) for attribute in ends)


def effective_shutter(
    camera: UsdGeom.Camera | None,
    frame: float | None,
    override: tuple[float, float] | None,
    still: bool,
    log: SceneLog,
) -> Shutter:
    """The shutter to read the stage for; `still` is the frame's own time (disableMotionBlur)."""
    if still:
        return Shutter(frame)
    opens, closes = authored_shutter(camera, frame, log) if override is None else override
    if not (math.isfinite(opens) and math.isfinite(closes)):
        log.warn(
            camera.GetPath() if camera else "", "shutter", "the shutter is not finite; 0 is used"
        )
        opens = closes = 0.0
    if closes < opens:
        text = f"shutter:close ({closes:g}) is before shutter:open ({opens:g}): no motion blur"
        log.warn(camera.GetPath() if camera else "", "shutter", text)
        closes = opens
    if frame is None:
        opens = closes = 0.0
    return Shutter(frame, opens, closes)


def read_camera(
    camera: UsdGeom.Camera, shutter: Shutter, transforms: TransformReader, log: SceneLog
) -> CameraState:
    """The camera at the frame; what cannot be read falls back, with a warning."""
    time = shutter.time
    return CameraState(
        path=str(camera.GetPath()),
        levels=transforms.levels(camera.GetPrim()),
        projection=token(camera.GetProjectionAttr(), PROJECTIONS, time, log),
        **read_lens(camera, shutter.code(shutter.open), time, log),
        aspect=aspect_of(read_lens(camera, time, time, log)),
        clipping=_clipping(camera, time, log),
        shutter=(shutter.open, shutter.close),
        aperture=read_aperture(camera, time, log),
        shutter_curve=read_shutter_curve(camera, time, log),
        clipping_planes=_clipping_planes(camera, time, log),
        lens_samples=read_lens_samples(camera, shutter, log),
    )


def aspect_of(lens: dict[str, float]) -> float:
    """Width over height; the default camera's where the renderer takes that one's film back."""
    width, height = lens["horizontal_aperture"], lens["vertical_aperture"]
    if not (0.0 < width < LARGEST_FILM and 0.0 < height < LARGEST_FILM):
        return DEFAULT_ASPECT
    # As usdrecord has it, which divides the authored floats, tenths of these: 24 by 16 is 1.5.
    aspect = float(np.float32(10.0 * width) / np.float32(10.0 * height))
    return aspect if 1e-4 < aspect < 1e6 else 1.0


def camera_aspect(camera: UsdGeom.Camera | None, frame: float | None, log: SceneLog) -> float:
    """Width over height of a camera's film back at a frame; without one, of that which frames the
    bounds."""
    if camera is None:
        return DEFAULT_ASPECT
    time = Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)
    return aspect_of(read_lens(camera, time, time, log))


def _clipping(camera: UsdGeom.Camera, time: Usd.TimeCode, log: SceneLog) -> tuple[float, float]:
    near, far = map(float, get_or_fallback(camera.GetClippingRangeAttr(), time, log))
    if near < 0.0:
        text = f"clippingRange begins at {near:g}, behind the camera"
        log.warn(camera.GetPath(), "clipping", text)
    return near, far


def _clipping_planes(camera: UsdGeom.Camera, time: Usd.TimeCode, log: SceneLog) -> np.ndarray:
    """clippingPlanes, (n, 4), in camera space."""
    value = get_or_ignore(camera.GetClippingPlanesAttr(), time, log)
    return np.array(value or (), dtype=np.float64).reshape(-1, 4)


def _sane_bounds(cache: UsdGeom.BBoxCache, root: Usd.Prim) -> Gf.Range3d:
    """World bounds of the subtree, without what is not finite or farther than LARGEST_BOUND.

    Instancers that are among their own prototypes have no bounds: USD would follow them without
    end.
    """
    box = Gf.Range3d()
    endless = endless_instancers(root.GetStage())
    above = {prefix for path in endless for prefix in path.GetPrefixes()} | {Sdf.Path("/")}
    pending = [root]
    while pending:
        prim = pending.pop()
        if prim.GetPath() in endless:
            continue
        if endless and prim.GetPath() in above:
            pending += prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
            continue
        try:
            found = cache.ComputeWorldBound(prim).ComputeAlignedRange()
        except FAULTS:
            found = None  # something in it cannot be read
        if found is not None and found.IsEmpty():
            continue
        if found is not None and all(
            abs(x) <= LARGEST_BOUND for end in (found.min, found.max) for x in end
        ):
            box.UnionWith(found)
        else:
            pending += prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
    return box


def framing_camera(stage: Usd.Stage, shutter: Shutter, purposes: list[str]) -> CameraState:
    """A 50 mm camera that sees the whole stage, as usdrecord places it.

    It looks along -z, or along +y where z is up, at the middle of the bounds, from far enough
    that the half diagonal of their front fits into half the horizontal field of view.
    """
    default = Gf.Camera()
    cache = UsdGeom.BBoxCache(shutter.time, purposes, True)
    with quiet():  # whoever reads a prim has more to say
        box = _sane_bounds(cache, stage.GetPseudoRoot())
    center, size = np.zeros(3), np.zeros(3)
    if not box.IsEmpty():
        center, size = np.array(box.GetMidpoint()), np.array(box.GetSize())
    z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    across, along = (size[[0, 2]], size[1]) if z_up else (size[[0, 1]], size[2])
    half_view = math.radians(default.GetFieldOfView(Gf.Camera.FOVHorizontal) / 2.0)
    distance = float(np.linalg.norm(across) / 2.0 / math.tan(half_view) + along / 2.0)
    near, far = default.clippingRange.min, default.clippingRange.max
    if distance < near:
        distance += near
    matrix = np.eye(4)
    if z_up:
        matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        matrix[3, :3] = center + np.array([0.0, -distance, 0.0])
    else:
        matrix[3, :3] = center + np.array([0.0, 0.0, distance])
    return CameraState(
        path="",
        levels=[static_level(matrix)],
        projection="perspective",
        horizontal_aperture=default.horizontalAperture * APERTURE_UNIT,
        vertical_aperture=default.verticalAperture * APERTURE_UNIT,
        horizontal_aperture_offset=0.0,
        vertical_aperture_offset=0.0,
        focal_length=default.focalLength * APERTURE_UNIT,
        focus_distance=default.focusDistance,
        f_stop=0.0,
        clipping=(near, far),
        shutter=(shutter.open, shutter.close),
        exposure_scale=1.0,
    )
