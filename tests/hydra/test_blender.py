"""The Blender add-on, in Blender as a Python module."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sdk
from images import read_exr, read_png

SCRIPT = """
import sys

sys.path[:0] = [{blender!r}, {addon!r}]
import bpy
import hdtrapeze_engine

hdtrapeze_engine.register()
scene = bpy.context.scene
scene.render.engine = "HDTRAPEZE"
scene.render.resolution_x, scene.render.resolution_y = 96, 64
scene.render.image_settings.color_mode = "RGBA"
scene.hdtrapeze.samples = 16
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()
bpy.ops.object.camera_add(location=(0, 0, 8))
scene.camera = camera = bpy.context.object
bpy.ops.mesh.primitive_plane_add(size=2)
camera.data.dof.use_dof = True
camera.data.dof.focus_distance = 4
for name, stop in (("sharp", 64), ("defocused", 0.1)):
    camera.data.dof.aperture_fstop = stop
    scene.render.filepath = name + ".png"
    bpy.ops.render.render(write_still=True)
bpy.context.view_layer.use_pass_z = True
scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
scene.render.image_settings.color_depth = "32"
scene.render.filepath = "passes.exr"
bpy.ops.render.render(write_still=True)
hdtrapeze_engine.unregister()
"""


WRONG = """
import sys

sys.path[:0] = [{blender!r}, {addon!r}]
import bpy
import hdtrapeze_engine

hdtrapeze_engine.register()
try:
    bpy.context.scene.render.engine = "HDTRAPEZE"
    print("there is an engine")
except TypeError:
    print("there is no engine")
hdtrapeze_engine.unregister()
"""

pytestmark = pytest.mark.skipif(
    sdk.configured() and not os.environ.get("OPENUSD_BLENDER"),
    reason="OPENUSD_BLENDER does not name the folder that holds Blender's module bpy",
)


def run(tmp_path, script, plugin):
    """A script in Blender's interpreter, with the folder of the plugin."""
    addon = sdk.ROOT / "examples/blender"
    script = script.format(blender=os.environ["OPENUSD_BLENDER"], addon=str(addon))
    environment = sdk.environment(False) | {"HDTRAPEZE_PLUGIN": str(plugin)}
    del environment["PXR_PLUGINPATH_NAME"]
    done = subprocess.run(
        [sdk.python(), "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done


@pytest.mark.parametrize("name", ["missing", "empty", "broken", "other", ""])
def test_a_wrong_plugin_folder_is_an_error(tmp_path, name):
    """Rather no engine than one whose images are black."""
    folder = tmp_path / name if name else ""
    if name not in ("missing", ""):
        folder.mkdir()
    if name in ("broken", "other"):
        info = (sdk.PLUGIN / "plugInfo.json").read_text()
        name_of = {"broken": "hdTrapeze", "other": "hdOther"}[name]
        (folder / "plugInfo.json").write_text(info.replace('"hdTrapeze"', f'"{name_of}"'))
    done = run(tmp_path, WRONG, folder)
    assert "there is no engine" in done.stdout
    assert done.stderr.count("ERROR: Trapeze: ") == 1
    assert str(folder) in done.stderr


def test_blender_renders_with_the_engine_of_the_add_on(tmp_path):
    run(tmp_path, SCRIPT, sdk.PLUGIN)
    alphas = {n: read_png(Path(tmp_path, f"{n}.png"))[..., 3] / 255 for n in ("sharp", "defocused")}
    areas = {name: alpha.mean() for name, alpha in alphas.items()}
    edges = {n: ((a > 0.05) & (a < 0.95)).mean() for n, a in alphas.items()}
    # Blender's camera has a film of 36 mm and a lens of 50: the plane fills 0.3472 of the width.
    assert areas["sharp"] == pytest.approx((2 / 8 * 50 / 36) ** 2 * 96 / 64, rel=0.02)
    assert areas["defocused"] == pytest.approx(areas["sharp"], rel=0.1)
    assert edges["defocused"] > 3 * edges["sharp"]
    assert np.all(alphas["sharp"][28:36, 40:56] > 0.99)
    depth = read_exr(tmp_path / "passes.exr")["ViewLayer.Depth.Z"]
    np.testing.assert_allclose(depth[28:36, 40:56], 8, rtol=1e-5)
