"""Blender add-on: hdTrapeze as a render engine (Blender 4.5 LTS, which carries OpenUSD 25.02).

Install it in Preferences > Add-ons > Install from Disk, name the folder that holds the plugin's
plugInfo.json in its preferences (or in the environment variable HDTRAPEZE_PLUGIN), and choose
Trapeze as the scene's render engine. The plugin must be built for Blender's own OpenUSD.
"""

import os
import sys
from pathlib import Path
from typing import ClassVar

import bpy

bl_info = {
    "name": "Trapeze",
    "description": "Micropolygon ray tracing with defocus and motion blur, through Hydra",
    "blender": (4, 5, 0),
    "version": (0, 1, 0),
    "category": "Render",
}

PLUGIN = "HdTrapezeRendererPlugin"

FILTERS = (
    ("box", "Box", "1 pixel wide"),
    ("gaussian", "Gaussian", "2 pixels wide"),
    ("mitchell", "Mitchell", "4 pixels wide, sharpens"),
    ("blackman-harris", "Blackman-Harris", "3 pixels wide"),
)

PASSES = (
    ("use_pass_combined", "Combined", "color", 4, "RGBA", "COLOR"),
    ("use_pass_z", "Depth", "cameraDepth", 1, "Z", "VALUE"),
    ("use_pass_normal", "Normal", "normal", 3, "XYZ", "VECTOR"),
)
"""Of a view layer: its switch, the pass' name, the AOV, components, their names, their kind."""


class TrapezePreferences(bpy.types.AddonPreferences):
    """Where the plugin is."""

    bl_idname = __name__
    error = ""

    plugin: bpy.props.StringProperty(
        name="Plugin folder",
        description="Holds plugInfo.json; read when the add-on is switched on",
        subtype="DIR_PATH",
    )

    def draw(self, _context):
        """The one field there is, and why there is no engine where it is wrong."""
        self.layout.prop(self, "plugin")
        if TrapezePreferences.error:
            self.layout.label(text=TrapezePreferences.error, icon="ERROR")


class TrapezeSettings(bpy.types.PropertyGroup):
    """What the renderer can be told, by its own names."""

    samples: bpy.props.IntProperty(
        name="Samples", description="Of each pixel; powers of four are best", default=64, min=1
    )
    preview_samples: bpy.props.IntProperty(
        name="Viewport Samples", description="Of each pixel in viewports", default=16, min=1
    )
    shading_rate: bpy.props.FloatProperty(
        name="Shading Rate",
        description="Edge of a micropolygon, in pixels",
        default=1.0,
        min=0.05,
        max=64.0,
    )
    filter: bpy.props.EnumProperty(name="Filter", items=FILTERS, default="gaussian")
    motion_blur: bpy.props.BoolProperty(
        name="Motion Blur",
        description="Of what Blender's Hydra hands on: 4.5 gives no motion of objects or points",
        default=True,
    )
    depth_of_field: bpy.props.BoolProperty(name="Depth of Field", default=True)

    @classmethod
    def register(cls):
        """Gives every scene its settings."""
        bpy.types.Scene.hdtrapeze = bpy.props.PointerProperty(name="Trapeze", type=cls)

    @classmethod
    def unregister(cls):
        """Takes them away."""
        del bpy.types.Scene.hdtrapeze


class TrapezeRenderEngine(bpy.types.HydraRenderEngine):
    """The engine: Blender drives the delegate, this says with which settings."""

    bl_idname = "HDTRAPEZE"
    bl_label = "Trapeze"
    bl_info = "Micropolygon ray tracing with defocus and motion blur"
    bl_use_preview = True
    bl_use_gpu_context = False
    bl_delegate_id = PLUGIN

    def get_render_settings(self, engine_type):
        """Settings of the delegate, and the AOVs of a final render."""
        scene = bpy.context.scene
        settings = scene.hdtrapeze
        is_viewport = engine_type == "VIEWPORT"
        values = {
            "trapeze:samples": settings.preview_samples if is_viewport else settings.samples,
            "trapeze:shadingRate": settings.shading_rate,
            "trapeze:filter": settings.filter,
            "trapeze:disableMotionBlur": not settings.motion_blur,
            "trapeze:disableDepthOfField": not settings.depth_of_field,
            "trapeze:timeCodesPerSecond": scene.render.fps / scene.render.fps_base,
        }
        if not is_viewport:
            values |= {f"aovToken:{name}": aov for _, name, aov, *_ in PASSES}
        return values

    def update_render_passes(self, scene, render_layer):
        """Tells Blender which passes there are."""
        for switch, name, _, size, channels, kind in PASSES:
            if getattr(render_layer, switch):
                self.register_pass(scene, render_layer, name, size, channels, kind)


class TrapezePanel(bpy.types.Panel):
    """Sampling, in the properties of the render."""

    bl_idname = "RENDER_PT_hdtrapeze"
    bl_label = "Trapeze"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES: ClassVar = {TrapezeRenderEngine.bl_idname}

    @classmethod
    def poll(cls, context):
        """Only where the scene uses the engine."""
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        """All settings below each other."""
        layout = self.layout
        layout.use_property_split = True
        for name in TrapezeSettings.__annotations__:
            layout.prop(context.scene.hdtrapeze, name)


CLASSES = (TrapezeSettings, TrapezeRenderEngine, TrapezePanel)
"""What there is where the plugin is; the preferences are there in any case."""


def plugin_folder() -> str:
    """The folder that holds plugInfo.json: of the preferences, else of HDTRAPEZE_PLUGIN."""
    addon = bpy.context.preferences.addons.get(__name__)
    chosen = addon.preferences.plugin if addon and addon.preferences else ""
    return chosen or os.environ.get("HDTRAPEZE_PLUGIN", "")


def _panels():
    """Blender's own panels that fit any engine which leaves shading to materials."""
    excluded = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes"}
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines and "BLENDER_RENDER" in engines and panel.__name__ not in excluded:
            yield panel


def load_plugin(folder: str) -> str:
    """Loads the plugin of a folder; why it cannot be, or nothing."""
    if not folder:
        return "no plugin folder is named"
    if not (Path(folder) / "plugInfo.json").is_file():
        return f"there is no plugInfo.json in {folder!r}"
    from pxr import Plug, Tf

    Plug.Registry().RegisterPlugins([folder])
    plugin = Plug.Registry().GetPluginWithName("hdTrapeze")
    try:
        loaded = plugin is not None and plugin.Load()
    except Tf.ErrorException as error:
        return f"the plugin in {folder!r} does not load: {error}"
    return "" if loaded else f"there is no plugin hdTrapeze in {folder!r}"


def register():
    """Loads the plugin, then adds the engine; without a plugin it would render nothing."""
    bpy.utils.register_class(TrapezePreferences)
    error = load_plugin(plugin_folder())
    TrapezePreferences.error = error
    if error:
        text = f"ERROR: Trapeze: {error}; choose the plugin folder in the add-on's preferences"
        print(text, file=sys.stderr)
        return
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in _panels():
        panel.COMPAT_ENGINES.add(TrapezeRenderEngine.bl_idname)


def unregister():
    """Removes the engine."""
    for panel in _panels():
        panel.COMPAT_ENGINES.discard(TrapezeRenderEngine.bl_idname)
    for cls in reversed(CLASSES):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
    bpy.utils.unregister_class(TrapezePreferences)


if __name__ == "__main__":
    register()
