"""What scripts of the tests have in a host: run as `host.py SCRIPT JSON` by OpenUSD's interpreter.

A script sees what is defined here, and the values of the JSON as globals.
"""

import json
import sys
import time
from pathlib import Path

from pxr import CameraUtil, Gf, Glf, Sdf, Usd, UsdAppUtils, UsdGeom, UsdImagingGL, Vt  # noqa: F401

PLUGIN = "HdTrapezeRendererPlugin"
_told = {}


def tell(**values):
    """Values that the test gets, of JSON's types."""
    _told.update(values)
    Path("told.json").write_text(json.dumps(_told))


def record(stage, out, camera=None, frame=1.0, width=96, **choices):
    """An image as usdrecord makes it, without a GPU; choices are FrameRecorder's setters."""
    recorder = UsdAppUtils.FrameRecorder(PLUGIN, False)
    recorder.SetColorCorrectionMode("disabled")
    recorder.SetImageWidth(width)
    for name, value in choices.items():
        getattr(recorder, f"Set{name}")(value)
    prim = stage.GetPrimAtPath(camera) if camera else Usd.Prim()
    time_code = Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)
    assert recorder.Record(stage, UsdGeom.Camera(prim), time_code, str(out))


def edit(stage, path, value, time=None):
    """Sets the attribute at a path such as /World/Box.points."""
    attribute = stage.GetAttributeAtPath(path)
    assert attribute.Set(value, Usd.TimeCode.Default() if time is None else time)


class View:
    """A view of a stage as in usdview: drawn again and again while its image gets better. Settings
    are render settings, without their namespace."""

    def __init__(
        self, stage, camera=None, size=(96, 64), aov="color", interactive=True, **settings
    ):
        wanted = UsdImagingGL.Engine.Parameters()
        wanted.gpuEnabled = False
        wanted.rendererPluginId = PLUGIN
        self.stage = stage
        self.engine = UsdImagingGL.Engine(wanted)
        assert self.engine.GetCurrentRendererId() == PLUGIN
        # Interactive ones keep surfaces that are finer than they have to be.
        self.engine.SetRendererSetting("enableInteractive", interactive)
        self.engine.SetRendererAov(aov)
        # Stands for one at the camera, wherever it is.
        light = Glf.SimpleLight()
        light.position = Gf.Vec4f(0, 0, 1, 1)
        self.engine.SetLightingState([light], Glf.SimpleMaterial(), Gf.Vec4f(0))
        if camera:
            self.engine.SetCameraPath(camera)
        self.resize(size)
        self.set(**settings)
        self.params = UsdImagingGL.RenderParams()
        self.params.colorCorrectionMode = "disabled"
        self.params.clearColor = Gf.Vec4f(0)

    def resize(self, size):
        window = Gf.Rect2i(Gf.Vec2i(0, 0), *size)
        self.engine.SetFraming(CameraUtil.Framing(window))
        self.engine.SetRenderBufferSize(Gf.Vec2i(*size))

    def set(self, **settings):
        for name, value in settings.items():
            self.engine.SetRendererSetting(f"trapeze:{name}", value)

    def draw(self, frame=1.0):
        """One call of the engine's, which waits for nothing; whether the image is all there."""
        self.params.frame = Usd.TimeCode(frame)
        self.engine.Render(self.stage.GetPseudoRoot(), self.params)
        return self.engine.IsConverged()

    def render(self, frame=1.0, timeout=30.0):
        """Draws until the image is all there; the number of draws."""
        end = time.monotonic() + timeout
        draws = 1
        while not self.draw(frame):
            assert time.monotonic() < end, "the render does not end"
            time.sleep(0.005)
            draws += 1
        return draws

    def save(self, path):
        assert self.engine.InvokeRendererCommand("saveImage", {"path": str(path)})

    def dump(self, path):
        assert self.engine.InvokeRendererCommand("dumpScene", {"path": str(path)})

    def stats(self):
        return dict(self.engine.GetRenderStats())


if __name__ == "__main__":
    _script, _values = sys.argv[1:]
    globals().update(json.loads(_values))
    exec(compile(Path(_script).read_text(), _script, "exec"))
