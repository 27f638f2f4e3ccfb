"""usdrecord's flags, one by one: what each changes in the image or in the messages.

--mask, --purposes, --sessionLayer, --frames, --traceToFile and more are in test_record; the two
that name prims of render settings are in test_usdrender.
"""

import json

import numpy as np
import pytest
from hdtrapeze.cli import main
from images import exr_header, read_png
from pxr import Gf, Kind, Usd, UsdGeom, UsdRender
from scenes import add_camera, add_quad, new_stage, quad_coverage, set_samples

FAST = ["--samples", "4", "--filter", "box"]
FULL = quad_coverage(-2, -2, 2, 2)


@pytest.fixture
def scene(tmp_path):
    """A stage with the primary camera and a quad; `save` writes it."""
    stage = new_stage()
    stage.SetStartTimeCode(1)
    add_camera(stage, "/main_cam")
    add_quad(stage)
    return stage


def save(stage, folder, name="scene.usda"):
    path = folder / name
    stage.GetRootLayer().Export(str(path))
    return path


def run(path, out, *flags, width=40):
    """The exit code of `record`."""
    wide = ["-w", width] if width else []
    try:
        return main([str(a) for a in ("record", path, out, *FAST, *wide, *flags)])
    except SystemExit as stop:
        return stop.code


def alpha(path):
    return read_png(path)[..., 3] / 255.0


def test_disable_gpu(scene, tmp_path):
    out = tmp_path / "a.exr"
    assert run(save(scene, tmp_path), out, "--disableGpu") == 0
    assert json.loads(exr_header(out)["hdtrapeze/settings"])["backend"] == "cpu"
    assert exr_header(out)["hdtrapeze/backend"] == "cpu"


def test_disable_camera_light(scene, tmp_path):
    path, out = save(scene, tmp_path), tmp_path / "a.png"
    assert run(path, out) == 0
    assert read_png(out)[20, 20, 0] > 100
    assert run(path, out, "--disableCameraLight") == 0
    assert not read_png(out)[..., :3].any()
    np.testing.assert_array_equal(alpha(out), FULL)


def test_disable_draw_mode(scene, tmp_path, capsys):
    """Without the flag each model that would be replaced is named once; both render in full."""
    models = []
    for name in ("a", "b"):
        prim = UsdGeom.Xform.Define(scene, f"/{name}").GetPrim()
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
        model = UsdGeom.ModelAPI.Apply(prim)
        model.CreateModelDrawModeAttr("bounds")
        model.CreateModelApplyDrawModeAttr(name == "a")
        add_quad(scene, f"/{name}/quad", -2, -2, 2, 2)
        models.append(prim)
    path, out = save(scene, tmp_path), tmp_path / "a.##.png"
    assert run(path, out, "-f", "1:2") == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "warning: /a: draw mode bounds is not supported yet; its geometry is rendered in full"
    ]
    assert run(path, out, "-f", "1:2", "--disableDrawMode") == 0
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(alpha(tmp_path / "a.02.png"), FULL)


def test_resolver_context(scene, tmp_path, capsys):
    """A search path is looked up beside the root layer only in the root layer's context."""
    (tmp_path / "below").mkdir()
    save(scene, tmp_path, "found.usda")
    (tmp_path / "below" / "sub.usda").write_text(
        '#usda 1.0\ndef "here" (references = @found.usda@</quad>)\n{\n}\n'
    )
    stage = new_stage()
    add_camera(stage, "/main_cam")
    stage.GetRootLayer().subLayerPaths.append("./below/sub.usda")
    path, out = save(stage, tmp_path), tmp_path / "a.png"
    assert run(path, out, "--resolverContext", "inherit") == 0
    assert "found.usda" in capsys.readouterr().err
    assert not alpha(out).any()
    assert run(path, out) == 0
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(alpha(out), FULL)
    assert run(path, out, "--resolverContext", "root") == 0
    np.testing.assert_array_equal(alpha(out), FULL)


@pytest.mark.parametrize("flag", ["--camera", "-cam"])
@pytest.mark.parametrize("name", ["/shots/other", "other"])
def test_camera(scene, tmp_path, flag, name):
    add_camera(scene, "/shots/other", horizontalAperture=40.0, verticalAperture=40.0)
    out = tmp_path / "a.png"
    assert run(save(scene, tmp_path), out, flag, name) == 0
    np.testing.assert_array_equal(alpha(out), quad_coverage(-1, -1, 1, 1))


def test_the_camera_that_is_named_wins(scene, tmp_path, capsys):
    add_camera(scene, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    add_camera(scene, "/tele", horizontalAperture=10.0, verticalAperture=10.0)
    settings = UsdRender.Settings.Define(scene, "/Render/settings")
    settings.CreateCameraRel().SetTargets(["/wide"])
    scene.SetMetadata("renderSettingsPrimPath", "/Render/settings")
    path, out = save(scene, tmp_path), tmp_path / "a.png"
    for flags, camera in (
        (["--camera", "/tele"], "/tele"),
        (["--camera", "tele", "-rs", "/Render/settings"], "/tele"),
        ([], "/wide"),
    ):
        assert run(path, out, *flags) == 0
        assert f"Camera: {camera}\n" in capsys.readouterr().out
    settings.GetCameraRel().SetTargets([])
    assert run(save(scene, tmp_path, "b.usda"), out) == 0
    assert "Camera: /main_cam\n" in capsys.readouterr().out
    scene.RemovePrim("/main_cam")
    assert run(save(scene, tmp_path, "c.usda"), out) == 0
    assert "Camera: none, framing the bounds\n" in capsys.readouterr().out


def test_default_time(scene, tmp_path):
    place = UsdGeom.Mesh.Get(scene, "/quad").AddTranslateOp().GetAttr()
    place.Set(Gf.Vec3d(0, 2, 0))
    set_samples(place, {1: Gf.Vec3d(2, 0, 0)})
    path, out = save(scene, tmp_path), tmp_path / "a.png"
    assert run(path, out) == 0
    np.testing.assert_array_equal(alpha(out), quad_coverage(0, -2, 4, 2))
    for flag in ("--defaultTime", "-d"):
        assert run(path, out, flag) == 0
        np.testing.assert_array_equal(alpha(out), quad_coverage(-2, 0, 2, 4))


def test_complexity_refines_the_shading_rate(scene, tmp_path):
    path, out = save(scene, tmp_path), tmp_path / "a.exr"
    rates = []
    for complexity in ("low", "medium", "high", "veryhigh"):
        assert run(path, out, "--complexity", complexity) == 0
        rates.append(exr_header(out)["hdtrapeze/shadingRate"])
    assert rates[0] == 1.0
    assert rates == sorted(rates, reverse=True)
    assert len(set(rates)) == 4
    assert run(path, out, "-c", "high", "--shading-rate", 4) == 0
    assert exr_header(out)["hdtrapeze/shadingRate"] == pytest.approx(4 * rates[2])


@pytest.mark.parametrize("name", ["Trapeze", "trapeze", "HdTrapezeRendererPlugin"])
@pytest.mark.parametrize("flag", ["--renderer", "-r"])
def test_renderer(scene, tmp_path, flag, name):
    assert run(save(scene, tmp_path), tmp_path / "a.png", flag, name) == 0


def test_image_width(scene, tmp_path):
    """960 where none is named; the height is the camera's aspect, cut to whole pixels."""
    UsdGeom.Camera.Get(scene, "/main_cam").GetVerticalApertureAttr().Set(15.0)
    path, out = save(scene, tmp_path), tmp_path / "a.png"
    for flag in ("--imageWidth", "-w"):
        assert run(path, out, flag, 30, width=None) == 0
        assert read_png(out).shape == (22, 30, 4)
    assert run(path, tmp_path / "b.exr", "--crop", 0, 0, 4, 4, width=None) == 0
    assert exr_header(tmp_path / "b.exr")["displayWindow"] == (0, 0, 959, 719)


def test_dome_light_visibility_is_accepted(scene, tmp_path, capsys):
    out = tmp_path / "a.png"
    assert run(save(scene, tmp_path), out, "--enableDomeLightVisibility") == 0
    assert capsys.readouterr().err == ""


def fail_at_frame_2(stage):
    """A camera without a finite place at frame 2."""
    place = UsdGeom.Camera.Get(stage, "/main_cam").GetOrderedXformOps()[0].GetAttr()
    set_samples(place, {1: Gf.Vec3d(0, 0, 10), 2: Gf.Vec3d(float("nan")), 3: Gf.Vec3d(0, 0, 10)})


def test_a_failing_frame_leaves_the_others(scene, tmp_path, capsys):
    """As usdrecord does; the exit code still says that not every frame is there."""
    fail_at_frame_2(scene)
    path = save(scene, tmp_path)
    assert run(path, tmp_path / "a.##.png", "-f", "1:3") == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "error: 1 of 3 frames failed."
    assert sum(line.startswith("error: Frame 2: ") for line in lines) == 1
    assert {p.name for p in tmp_path.glob("a.*")} == {"a.01.png", "a.03.png"}
    assert run(path, tmp_path / "b.##.png", "-f", "1:3", "--abortOnError") == 1
    assert {p.name for p in tmp_path.glob("b.*")} == {"b.01.png"}
    assert run(path, tmp_path / "c.##.png", "-f", "2") == 1
    assert "frames failed" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["-rs", "/a", "-rp", "/b"], "Only one of"),
        (["-rs", "not a path"], "--renderSettingsPrimPath"),
        (["-rp", "not a path"], "--renderPassPrimPath"),
        (["--complexity", "ultra"], "--complexity"),
        (["--traceFormat", "xml"], "--traceFormat"),
        (["--imageWidth", "wide"], "--imageWidth"),
        (["--resolverContext", "none"], "--resolverContext"),
        (["-color", "rec709"], "-color"),
        (["--purposes", "preview"], "'preview' is no purpose"),
        (["--mask", "quad"], "absolute path"),
        (["--disableDrawModes"], "Did you mean --disableDrawMode?"),
        (["--compression", "lzw"], "--compression"),
        (["--filter-width", "99"], "Filter width cannot be 99: it must be from 0 to 32."),
        (["--threads", "-1"], "Threads"),
    ],
)
def test_wrong_flags(scene, tmp_path, capsys, flags, words):
    assert run(save(scene, tmp_path), tmp_path / "a.png", *flags) == 2
    text = capsys.readouterr().err
    assert words in text
    assert text.endswith("See `hdtrapeze record --help`.\n")
    assert not (tmp_path / "a.png").exists()


def test_prims_that_are_not_there(scene, tmp_path, capsys):
    path, out = save(scene, tmp_path), tmp_path / "a.png"
    for flag, kind in (("-rs", "RenderSettings"), ("-rp", "RenderPass")):
        for prim in ("/nobody", "/quad"):
            assert run(path, out, flag, prim) == 1
            assert f"{prim} is not a {kind} prim" in capsys.readouterr().err
    assert run(path, out, "--sessionLayer", tmp_path / "none.usda") == 3
    assert not out.exists()
