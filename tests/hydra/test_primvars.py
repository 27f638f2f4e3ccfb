"""Primvars as AOVs, by way of a host and by `hdtrapeze record --aov`.

Element sizes are not among them: Hydra had no word for these up to 25.02 at least.
"""

import numpy as np
import pytest
from driver import record
from images import read_exr
from pxr import Sdf, UsdGeom, Vt
from scenes import add_camera, add_grid, add_quad, new_stage

DRAW = """
view = View(Usd.Stage.Open(scene), "/camera", size=(48, 48), aov=aov, samples=4)
view.render(0)
view.save("hydra.exr")
"""
TYPES = Sdf.ValueTypeNames


def add(prim, name, kind, interpolation, values, indices=None):
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation)
    primvar.Set(values)
    if indices:
        primvar.SetIndices(Vt.IntArray(indices))


CASES = {
    "st": lambda mesh: add(
        mesh, "st", TYPES.TexCoord2fArray, "faceVarying", [(i / 16, 1 - i / 16) for i in range(16)]
    ),
    "indexed": lambda mesh: add(
        mesh,
        "indexed",
        TYPES.FloatArray,
        "faceVarying",
        [0.0, 1.0, 3.0],
        [i % 3 for i in range(16)],
    ),
    "vertex": lambda mesh: add(
        mesh, "vertex", TYPES.Float3Array, "vertex", [(i, i * i, 1) for i in range(9)]
    ),
    "varying": lambda mesh: add(mesh, "varying", TYPES.HalfArray, "varying", list(range(9))),
    "uniform": lambda mesh: add(mesh, "uniform", TYPES.IntArray, "uniform", [-3, 7, 100000, 1]),
    "constant": lambda mesh: add(mesh, "constant", TYPES.Double3, "constant", (1, 2, 3)),
    "truth": lambda mesh: add(mesh, "truth", TYPES.BoolArray, "uniform", [True, False, True, True]),
}


@pytest.mark.parametrize("name", CASES)
def test_aov(host, name):
    stage = new_stage()
    add_camera(stage)
    CASES[name](add_grid(stage, "/grid", 2, 3.0, "catmullClark" if name == "vertex" else "none"))
    add_quad(stage, "/without", -5, -5, -3.5, -3.5, 1.0)
    scene = host.folder / "scene.usda"
    stage.Export(str(scene))
    ran = host.run(DRAW, scene=scene, aov=f"primvars:{name}")
    assert ran.warnings == []
    flags = ["-w", 48, "-cam", "/camera", "--aov", f"primvars:{name}", "--samples", 4, "--float"]
    record(scene, host.folder / "record.exr", *flags)
    ours, other = (read_exr(host.folder / f"{who}.exr") for who in ("hydra", "record"))
    names = [channel for channel in other if channel.startswith(name)]
    assert names
    for channel in names:
        assert np.ptp(other[channel]) > 0
        np.testing.assert_array_equal(ours[channel], other[channel])
