"""Occlusion culling: the same bits with and without it, and its counts."""

import json
from pathlib import Path

import numpy as np
import pytest
from hdtrapeze.cli import main
from images import exr_header
from pxr import Gf, Usd, UsdGeom
from scenes import add_camera, add_quad, new_stage, render

DEMO = Path(__file__).parents[2] / "examples/demo/demo.usda"
AOVS = ("color", "depth", "P", "normal", "primId", "instanceId", "elementId", "motionVectors")


def both(stage, **settings):
    """The image with occlusion culling, which has the bits of the one without."""
    off = render(stage, aovs=AOVS, occlusion_culling=False, threads=2, **settings)
    assert off.statistics["clusters"] == 0
    for threads in (1, 3):
        on = render(stage, aovs=AOVS, threads=threads, **settings)
        for name in AOVS:
            np.testing.assert_array_equal(on[name], off[name], err_msg=name)
    assert on.warnings == off.warnings
    return on


def test_the_demo():
    stage = Usd.Stage.Open(str(DEMO))
    settings = {"frame": 1.0, "width": 120, "height": 68, "shading_rate": 0.12}
    image = both(stage, camera=None, **settings)
    assert image.statistics["clusters"] > 0


def test_spheres_behind_a_sheet_that_leaves():
    stage = new_stage()
    add_camera(stage, fStop=4.0, focusDistance=9.0, shutter__open=0.0, shutter__close=1.0)
    sheet = add_quad(stage, "/sheet", -9, -9, 9, 9, z=1, color=(0.2, 0.5, 0.3))
    for i in range(4):
        sphere = UsdGeom.Sphere.Define(stage, f"/sphere{i}")
        sphere.AddTranslateOp().Set(Gf.Vec3d(0.8 * i - 1.2, 0.5 * i - 1, -1))
        sphere.GetRadiusAttr().Set(1.0, 0)
        sphere.GetRadiusAttr().Set(1.2, 1)
    hidden = both(stage, shading_rate=0.1).statistics
    assert hidden["clusters_culled"] == hidden["clusters"] == 4
    assert hidden["micropolygons_culled"] > 10_000 > hidden["micropolygons"]
    slide = sheet.AddTranslateOp()
    for time, x in ((0, 0), (0.9, 0), (1, 12)):
        slide.Set(Gf.Vec3d(x, 0, 0), time)
    seen = both(stage, shading_rate=0.1).statistics
    assert seen["clusters_culled"] < 4


@pytest.mark.parametrize(("flags", "on"), [([], True), (["--no-occlusion-culling"], False)])
def test_the_flag(flags, on, tmp_path):
    stage = new_stage()
    add_camera(stage)
    add_quad(stage)
    stage.GetRootLayer().Export(str(tmp_path / "scene.usda"))
    image = tmp_path / "image.exr"
    command = ["record", str(tmp_path / "scene.usda"), str(image), "-w", "8", "--samples", "1"]
    assert main([*command, *flags]) == 0
    assert json.loads(exr_header(image)["hdtrapeze/settings"])["occlusion_culling"] is on
