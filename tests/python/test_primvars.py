"""displayColor in every interpolation, indexed and inherited."""

import numpy as np
import pytest
from hdtrapeze.cli import main
from images import read_exr
from pxr import Gf, Sdf, UsdGeom, Vt
from scenes import add_camera, add_grid, new_stage, one_warning, pixel, render

RED, GREEN, BLUE, GRAY = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.5, 0.5)


def albedo(image, x, y):
    """The color of a surface that faces the camera, without the light."""
    white = 15000.0 * 2 * (1 - np.cos(np.radians(0.53 / 2)))
    return image["color"][pixel(x, y)][:3] / white


def scene(interpolation, values, scheme="none", n=2, indices=None):
    stage = new_stage()
    add_camera(stage)
    grid = add_grid(stage, n=n, scheme=scheme)
    primvar = grid.CreateDisplayColorPrimvar(interpolation)
    primvar.Set(Vt.Vec3fArray([Gf.Vec3f(*map(float, value)) for value in values]))
    if indices is not None:
        primvar.SetIndices(indices)
    return stage


SCHEMES = ("none", "bilinear", "catmullClark")
FACES = ((-1, -1), (1, -1), (-1, 1), (1, 1))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_constant(scheme):
    image = render(scene("constant", [GREEN], scheme))
    np.testing.assert_allclose(albedo(image, 1, 1), GREEN, atol=3e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_uniform(scheme):
    colors = (RED, GREEN, BLUE, GRAY)
    image = render(scene("uniform", colors, scheme))
    for at, color in zip(FACES, colors, strict=True):
        np.testing.assert_allclose(albedo(image, *at), color, atol=3e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("interpolation", ["vertex", "varying"])
def test_per_vertex_is_linear_where_the_values_are(scheme, interpolation):
    # A linear ramp stays one on a regular flat grid with every scheme, the border aside.
    steps = np.linspace(0, 1, 5)
    values = [(x, y, 0.5) for y in steps for x in steps]
    image = render(scene(interpolation, values, scheme, n=4), samples=16)
    for x in (-0.875, -0.375, 0.125, 0.875):
        for y in (-0.875, 0.375):
            expected = [(x + 2) / 4, (y + 2) / 4, 0.5]
            np.testing.assert_allclose(albedo(image, x, y), expected, atol=6e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_face_varying_can_jump(scheme):
    values = [c for face in (RED, GREEN, BLUE, GRAY) for c in [face] * 4]
    image = render(scene("faceVarying", values, scheme))
    for at, color in zip(FACES, (RED, GREEN, BLUE, GRAY), strict=True):
        np.testing.assert_allclose(albedo(image, *at), color, atol=3e-3)


def test_face_varying_runs_within_a_face():
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    image = render(scene("faceVarying", corners, n=1), samples=16)
    np.testing.assert_allclose(albedo(image, 0.875, -0.875), [0.71875, 0.28125, 0], atol=6e-3)


def test_vertex_and_varying_differ_on_subdivision_surfaces():
    # A peak in the middle of 4 x 4 faces: smoothing lowers it, varying keeps it.
    peak = [(1, 1, 1) if i == 12 else (0, 0, 0) for i in range(25)]
    smooth = albedo(render(scene("vertex", peak, "catmullClark", n=4), samples=64), 0.1, 0.1)
    linear = albedo(render(scene("varying", peak, "catmullClark", n=4), samples=64), 0.1, 0.1)
    # A cubic B-spline in x and y, averaged over the pixel next to the vertex.
    spline = np.mean([2 / 3 - t**2 + t**3 / 2 for t in np.linspace(0, 0.25, 100)])
    assert smooth[0] == pytest.approx(spline**2, abs=0.015)
    assert linear[0] > 0.7


def test_indexed():
    image = render(scene("uniform", [BLUE, RED], indices=[1, 0, 0, 1]))
    for at, color in zip(FACES, (RED, BLUE, BLUE, RED), strict=True):
        np.testing.assert_allclose(albedo(image, *at), color, atol=3e-3)


def test_inherited_from_a_parent():
    stage = new_stage()
    add_camera(stage)
    add_grid(stage, "/parent/grid")
    parent = UsdGeom.Xform.Define(stage, "/parent")
    color = UsdGeom.PrimvarsAPI(parent).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, "constant"
    )
    color.Set(Vt.Vec3fArray([Gf.Vec3f(0, 0, 1)]))
    np.testing.assert_allclose(albedo(render(stage), 1, 1), BLUE, atol=3e-3)


def test_without_color_it_is_gray():
    stage = new_stage()
    add_camera(stage)
    add_grid(stage)
    image = render(stage)
    np.testing.assert_allclose(albedo(image, 1, 1), [0.18] * 3, atol=1e-3)
    assert image.warnings == []


@pytest.mark.parametrize("interpolation", ["uniform", "varying", "vertex", "faceVarying"])
def test_wrong_length_gives_one_warning_and_the_mesh(interpolation):
    image = render(scene(interpolation, [RED, GREEN, BLUE]))
    one_warning(image, "/grid", "displayColor")
    assert image.alpha[pixel(1, 1)] == 1


def test_indices_out_of_range_give_one_warning():
    image = render(scene("uniform", [RED, GREEN], indices=[0, 1, 2, -1]))
    one_warning(image, "/grid", "displayColor")
    assert image.alpha[pixel(1, 1)] == 1


def test_a_block_holds_what_is_before_it_and_hides_what_is_after():
    stage = scene("constant", [RED])
    color = UsdGeom.Mesh.Get(stage, "/grid").GetDisplayColorPrimvar().GetAttr()
    for time, value in ((0, RED), (2, None), (3, BLUE), (4, GREEN)):
        color.Set(Sdf.ValueBlock() if value is None else [Gf.Vec3f(*value)], time)

    def at(frame, shutter=(0, 0)):
        return albedo(render(stage, frame=frame, shutter=shutter, samples=64), 1, 1)

    np.testing.assert_allclose(at(1, (-0.5, 0.5)), RED, atol=3e-3)
    np.testing.assert_allclose(at(1, (-0.5, 2.5)), RED, atol=3e-3)
    np.testing.assert_allclose(at(2.5, (-1.0, 1.0)), [0.18] * 3, atol=3e-3)
    np.testing.assert_allclose(at(3, (-0.8, 0.0)), BLUE, atol=3e-3)
    np.testing.assert_allclose(at(3, (0.0, 1.0)), [0, 0.5, 0.5], atol=0.05)


def test_primvars_as_aovs_of_the_command(tmp_path, capsys):
    stage = scene("constant", [RED])
    api = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/grid"))
    api.CreatePrimvar("hash", Sdf.ValueTypeNames.UInt, "constant").Set(0xFEDCBA98)
    api.CreatePrimvar("wear", Sdf.ValueTypeNames.FloatArray, "uniform").Set([0.5, 1.0, 1.0, 1.0])
    file, out = tmp_path / "scene.usda", tmp_path / "out.exr"
    stage.GetRootLayer().Export(str(file))
    flags = ["-cam", "/camera", "-w", "40", "--samples", "4", "--filter", "box", "--float"]
    aovs = ["--aov", "primvars:hash", "--aov", "primvars:wear"]
    assert main(["record", str(file), str(out), *flags, *aovs]) == 0
    assert capsys.readouterr().err == ""
    channels = read_exr(out)
    assert channels["hash.X"][pixel(1, 1)] == 0xFEDCBA98
    assert channels["hash.X"][0, 0] == 0xFFFFFFFF
    assert channels["wear.X"][pixel(-1, -1)] == 0.5
    assert main(["record", str(file), str(out), *flags, "--aov", "primvars:"]) == 2
    assert main(["record", str(file), str(out), *flags, "--aov", "wear"]) == 2
    assert "primvars:NAME" in capsys.readouterr().err
