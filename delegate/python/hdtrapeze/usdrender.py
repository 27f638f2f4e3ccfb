"""Finds the RenderPass and the RenderSettings that a command renders with.

The order is usdrecord's: the settings prim that is named, else the renderSource of the pass that
is named, else the one of the stage's metadata (renderSettingsPrimPath).
"""

from pxr import Sdf, Usd, UsdHydra, UsdRender

from .errors import SceneError, UsageError
from .log import SceneLog

RENDERER_NAMES = ("trapeze", "hdtrapeze", "hdtrapezerendererplugin")
"""Names that mean this renderer, in lower case."""


def find_render_pass(
    stage: Usd.Stage, path: str | None, renderer_named: bool, log: SceneLog
) -> UsdRender.Pass | None:
    """The RenderPass prim at `path`; the log hears of what it asks for that is not done."""
    if not path:
        return None
    prim = _prim_at(stage, path, "--renderPassPrimPath")
    render_pass = UsdRender.Pass(prim)
    if not render_pass:
        raise SceneError(f"{path} is not a RenderPass prim of this stage{_masked(stage, path)}.")
    renderer = UsdHydra.RenderPassAPI(prim).GetHydraRendererNameAttr().Get()
    if renderer and renderer.lower() not in RENDERER_NAMES and not renderer_named:
        text = f"it asks for the renderer {renderer}; this command has only Trapeze"
        log.warn(path, "render-pass", text)
    if render_pass.GetInputPassesRel().HasAuthoredTargets():
        log.say(20, str(path), "render-pass", "its inputPasses are not rendered by this command")
    return render_pass


def find_render_settings(
    stage: Usd.Stage,
    settings_path: str | None,
    render_pass: UsdRender.Pass | None,
    log: SceneLog,
) -> UsdRender.Settings | None:
    """The settings prim: named, or of the render pass, or of the stage's metadata."""
    named = settings_path or render_pass
    if render_pass:
        settings_path = _render_source(render_pass, log)
    if not settings_path:
        settings_path = stage.GetMetadata("renderSettingsPrimPath") or None
    if not settings_path:
        return None
    if not named and not settings_path.startswith("/"):
        text = f"its renderSettingsPrimPath is {settings_path}, which is no absolute path; ignored"
        log.warn("/", "render-settings", text)
        return None
    settings = UsdRender.Settings(_prim_at(stage, settings_path, "--renderSettingsPrimPath"))
    if settings:
        return settings
    masked = _masked(stage, settings_path)
    if named:
        raise SceneError(f"{settings_path} is not a RenderSettings prim of this stage{masked}.")
    if not masked:
        text = "the stage names it, but it is no RenderSettings prim"
        log.warn(settings_path, "render-settings", text)
    return None


def _render_source(render_pass: UsdRender.Pass, log: SceneLog) -> str:
    path = render_pass.GetPath()
    targets = render_pass.GetRenderSourceRel().GetForwardedTargets()
    file = render_pass.GetFileNameAttr().Get()
    if file and file.path:
        raise SceneError(
            f"{path} takes its settings from another file (fileName {file.path}), which only the "
            f"renderer that it belongs to can read."
        )
    if not targets:
        raise SceneError(f"{path} has no renderSource.")
    if len(targets) > 1:
        log.warn(path, "render-pass", f"has several render sources; using {targets[0]}")
    return str(targets[0])


def _masked(stage: Usd.Stage, path: str) -> str:
    """What to add to a message about a prim that --mask left out."""
    included = stage.GetPopulationMask().Includes(Sdf.Path(path))
    return "" if included else ": --mask leaves it out"


def _prim_at(stage: Usd.Stage, path: str, flag: str) -> Usd.Prim:
    if not Sdf.Path.IsValidPathString(str(path)) or not Sdf.Path(path).IsPrimPath():
        raise UsageError(f"{flag}: {path!r} is not the path of a prim.")
    if not Sdf.Path(path).IsAbsolutePath():
        raise UsageError(f"{flag}: {path!r} must be an absolute path, such as /{path}.")
    return stage.GetPrimAtPath(path)
