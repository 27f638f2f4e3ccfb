"""RenderSettings, RenderProducts and RenderVars: what they say, and the files that they make."""

import hdtrapeze
import numpy as np
import pytest
from hdtrapeze.frames import expand_frame
from images import exr_header, read_exr, read_png
from pxr import Gf, Sdf, UsdGeom
from scenes import add_camera, quad_coverage, set_samples
from usdrender_scene import FAST, FULL, HALF, Scene, alpha, one, warnings


@pytest.fixture
def scene(tmp_path):
    return Scene(tmp_path)


# Products ----------------------------------------------------------------------------------------


def test_a_product_is_written_beside_the_image_that_is_named(scene, capsys):
    scene.var("normals", sourceName="normal", dataType="normal3f")
    scene.var("id", sourceName="primId", dataType="int")
    scene.product("beauty", "color", "normals", "id")
    assert scene.run() == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert f"{scene.path('beauty.exr')}: frame 1, 40 x 40, 4 samples" in captured.out
    header = exr_header(scene.path("beauty.exr"))
    assert header["channels"] == {
        "R": "half",
        "G": "half",
        "B": "half",
        "A": "half",
        "normals.X": "float",
        "normals.Y": "float",
        "normals.Z": "float",
        "id.X": "uint",
    }
    assert header["hdtrapeze/renderProduct"] == "/Render/beauty"
    assert header["hdtrapeze/renderSettings"] == "/Render/settings"
    assert header["hdtrapeze/camera"] == "/main_cam"
    pixels = read_exr(scene.path("beauty.exr"))
    np.testing.assert_array_equal(pixels["A"], FULL)
    inside = FULL == 1
    np.testing.assert_array_equal(pixels["normals.Z"][inside], 1.0)
    assert set(np.unique(pixels["id.X"])) == {0, 2**32 - 1}
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, FULL)


def test_products_of_the_stages_metadata_are_written_too(scene):
    scene.product("beauty")
    assert scene.run("-w", 20, named=False) == 0
    np.testing.assert_array_equal(alpha(scene.path("beauty.exr")), FULL)
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, HALF)


def test_products_can_be_left_out(scene):
    scene.product("beauty")
    assert scene.run("--no-products") == 0
    assert scene.path("own.png").exists()
    assert not scene.path("beauty.exr").exists()


def test_a_product_overrides_only_what_it_authors(scene):
    add_camera(scene.stage, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    scene.settings.CreateCameraRel().SetTargets(["/main_cam"])
    scene.product("plain")
    scene.product("small", resolution=Gf.Vec2i(20, 20))
    scene.product("wide").CreateCameraRel().SetTargets(["/wide"])
    assert scene.run() == 0
    np.testing.assert_array_equal(alpha(scene.path("plain.exr")), FULL)
    np.testing.assert_array_equal(alpha(scene.path("small.exr")), HALF)
    wide = quad_coverage(-1, -1, 1, 1)
    np.testing.assert_array_equal(alpha(scene.path("wide.exr")), wide)
    assert exr_header(scene.path("wide.exr"))["hdtrapeze/camera"] == "/wide"


def test_flags_of_the_image_leave_products_alone(scene):
    """--camera and --imageWidth are about the image that is named; all others win."""
    add_camera(scene.stage, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    scene.settings.CreateCameraRel().SetTargets(["/main_cam"])
    scene.product("beauty")
    assert scene.run("--camera", "/wide", "-w", 20, "--seed", 7) == 0
    own = read_png(scene.path("own.png"))[..., 3] / 255.0
    np.testing.assert_array_equal(own, quad_coverage(-1, -1, 1, 1, size=20))
    np.testing.assert_array_equal(alpha(scene.path("beauty.exr")), FULL)
    assert exr_header(scene.path("beauty.exr"))["hdtrapeze/seed"] == 7


def test_without_a_camera_of_the_settings_products_use_the_commands(scene):
    add_camera(scene.stage, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    scene.product("beauty")
    assert scene.run("--camera", "/wide") == 0
    np.testing.assert_array_equal(alpha(scene.path("beauty.exr")), quad_coverage(-1, -1, 1, 1))


def count_renders(monkeypatch):
    counted = []
    original = hdtrapeze.render.Renderer.render
    monkeypatch.setattr(
        hdtrapeze.render.Renderer,
        "render",
        lambda self, *args: counted.append(list(self.options.aovs)) or original(self, *args),
    )
    return counted


def test_products_that_agree_share_a_render(scene, monkeypatch):
    counted = count_renders(monkeypatch)
    scene.var("depth")
    scene.var("ids", sourceName="primId")
    scene.product("a", "color", "depth")
    scene.product("b", "ids")
    scene.product("c", "color", resolution=Gf.Vec2i(20, 20))
    assert scene.run() == 0
    assert counted == [["color", "depth", "primId"], ["color"]], "the one that is named is first"
    assert set(exr_header(scene.path("b.exr"))["channels"]) == {"ids.X"}
    assert set(exr_header(scene.path("a.exr"))["channels"]) == {*"RGBA", "depth.Z"}
    counted.clear()
    assert scene.run("-w", 30, "--no-motion-blur") == 0
    assert len(counted) == 3


def test_crops_and_overscans_are_of_the_images_that_are_rendered(scene, monkeypatch, capsys):
    counted = count_renders(monkeypatch)
    # Pixels that an image of 960 x 960, the command's without a shape of settings, has not.
    scene.settings.GetResolutionAttr().Set(Gf.Vec2i(1200, 1080))
    scene.product("shot")
    scene.product("small", resolution=Gf.Vec2i(40, 40))
    crop = ["--crop", 0, 1000, 100, 1080]
    assert scene.run(*crop, out="own.exr") == 1
    one(capsys, "/Render/small", "holds no pixel of an image of 40 x 40")
    assert len(counted) == 1
    for name in ("own", "shot"):
        header = exr_header(scene.path(f"{name}.exr"))
        assert header["dataWindow"] == (0, 1000, 99, 1079)
        assert header["displayWindow"] == (0, 0, 1199, 1079)
    counted.clear()
    scene.settings.GetResolutionAttr().Set(Gf.Vec2i(40, 40))
    assert scene.run("--overscan", 2, out="own.exr") == 0
    assert len(counted) == 1
    for name in ("own", "shot", "small"):
        assert exr_header(scene.path(f"{name}.exr"))["dataWindow"] == (-2, -2, 41, 41)
    assert scene.run("--crop", 50, 0, 60, 20) == 2
    assert "no pixel of an image of 40 x 40" in capsys.readouterr().err


def test_blur_and_lens_of_products(scene, monkeypatch):
    counted = count_renders(monkeypatch)
    camera = UsdGeom.Camera.Get(scene.stage, "/main_cam")
    camera.CreateShutterCloseAttr(1.0)
    set_samples(scene.quad.AddTranslateOp().GetAttr(), {1: Gf.Vec3d(0), 2: Gf.Vec3d(2, 0, 0)})
    scene.product("blurred")
    scene.product("still", disableMotionBlur=True)
    scene.product("old", instantaneousShutter=True)
    assert scene.run() == 0
    blurred = alpha(scene.path("blurred.exr"))
    assert ((blurred > 0) & (blurred < 1)).sum() > 50
    for name in ("still.exr", "old.exr"):
        np.testing.assert_array_equal(alpha(scene.path(name)), FULL)
    assert len(counted) == 2, "still and old are one render"
    scene.settings.CreateDisableMotionBlurAttr(True)
    scene.product("blurred", disableMotionBlur=False)
    assert scene.run() == 0
    np.testing.assert_array_equal(alpha(scene.path("blurred.exr")), blurred)
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, FULL)


def test_png_products_hold_color(scene, capsys):
    scene.var("depth")
    scene.product("shot", "depth", "color", file="shot.png")
    assert scene.run() == 0
    one(capsys, "/Render/shot", "PNG", "only color")
    np.testing.assert_array_equal(read_png(scene.path("shot.png")), read_png(scene.path("own.png")))


def test_names_of_files_hold_the_frame(scene, capsys):
    scene.product("shot", file="shot.####.exr")
    scene.product("four", file="four.<F4>.exr")
    sampled = scene.product("sampled").GetProductNameAttr()
    sampled.Clear()
    set_samples(sampled, {1: str(scene.path("first.exr")), 2: str(scene.path("second.exr"))})
    assert scene.run("-f", "1:2", out="own.##.png") == 0
    assert warnings(capsys) == []
    names = {file.name for file in scene.folder.glob("*.exr")}
    assert names == {
        *("shot.0001.exr", "shot.0002.exr", "four.0001.exr", "four.0002.exr"),
        *("first.exr", "second.exr"),
    }


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("a.###.exr", 7, "a.007.exr"),
        ("a.##.##.exr", 7.25, "a.07.25.exr"),
        ("a.<F>.exr", 7, "a.7.exr"),
        ("a.<F3>.$F.$F2.${F}.${F5}.exr", 7.9, "a.007.7.07.7.00007.exr"),
        ("a.%d.%04d.exr", -3, "a.-3.-003.exr"),
        ("100%.$FOO.exr", 7, "100%.7OO.exr"),
        ("a.####.exr", None, "a.0000.exr"),
        ("a.exr", 3, "a.exr"),
    ],
)
def test_placeholders(name, frame, expected):
    assert expand_frame(name, frame) == expected


def test_a_name_without_the_frame_is_replaced_and_said(scene, capsys):
    scene.product("shot")
    assert scene.run("-f", "1:3", out="own.##.png") == 0
    one(capsys, "/Render/shot", "each frame replaces", "####")
    assert exr_header(scene.path("shot.exr"))["hdtrapeze/frame"] == 3


def test_relative_names_are_in_the_working_folder(scene, monkeypatch, tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    monkeypatch.chdir(folder)
    scene.product("shot").GetProductNameAttr().Set("shot.exr")
    assert scene.run() == 0
    assert (folder / "shot.exr").exists()


# The image's shape -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("policy", "window"),
    [
        # Half width and height of the view at z = 0, of a 2:1 image through a square aperture.
        ("expandAperture", (10, 5)),
        ("cropAperture", (5, 2.5)),
        ("adjustApertureWidth", (10, 5)),
        ("adjustApertureHeight", (5, 2.5)),
        ("adjustPixelAspectRatio", (5, 5)),
    ],
)
def test_conform_policies(scene, policy, window):
    scene.settings.CreateAspectRatioConformPolicyAttr(policy)
    scene.product("shot", resolution=Gf.Vec2i(40, 20))
    assert scene.run() == 0
    header = exr_header(scene.path("shot.exr"))
    expected = 0.5 if policy == "adjustPixelAspectRatio" else 1.0
    assert header["pixelAspectRatio"] == expected
    columns = (np.arange(40) + 0.5) / 20 - 1
    rows = 1 - (np.arange(20) + 0.5) / 10
    inside = (abs(rows * window[1]) < 2)[:, None] & (abs(columns * window[0]) < 2)
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")) > 0.5, inside)


def test_pixel_aspect(scene):
    scene.product("shot", resolution=Gf.Vec2i(20, 40), pixelAspectRatio=2.0)
    assert scene.run() == 0
    assert exr_header(scene.path("shot.exr"))["pixelAspectRatio"] == 2.0
    expected = quad_coverage(-2, -2, 2, 2).reshape(40, 20, 2).mean(axis=2)
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")), expected)


def test_the_data_window_crops(scene):
    scene.product("shot", dataWindowNDC=Gf.Vec4f(0.25, 0.5, 0.75, 1.0))
    assert scene.run() == 0
    header = exr_header(scene.path("shot.exr"))
    assert header["dataWindow"] == (10, 0, 29, 19)
    assert header["displayWindow"] == (0, 0, 39, 39)
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")), FULL[:20, 10:30])


def test_the_data_window_can_reach_out_of_the_image(scene):
    scene.product("shot", dataWindowNDC=Gf.Vec4f(-0.25, 0.0, 1.0, 1.5))
    assert scene.run() == 0
    header = exr_header(scene.path("shot.exr"))
    assert header["dataWindow"] == (-10, -20, 39, 39)
    assert header["displayWindow"] == (0, 0, 39, 39)
    expected = np.pad(FULL, ((20, 0), (10, 0)))
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")), expected)


def test_a_data_window_without_a_pixel(scene, capsys):
    scene.product("good")
    scene.product("shot", dataWindowNDC=Gf.Vec4f(0.501, 0.0, 0.502, 1.0))
    assert scene.run() == 1
    one(capsys, "/Render/shot", "holds no pixel", "it is not written")
    assert alpha(scene.path("good.exr")).any()
    scene.product("shot", dataWindowNDC=Gf.Vec4f(0, 0, 99, 99), resolution=Gf.Vec2i(2048, 40))
    assert scene.run() == 1
    one(capsys, "/Render/shot", "65536")
    scene.settings.CreateDataWindowNDCAttr(Gf.Vec4f(0.501, 0.0, 0.502, 1.0))
    assert scene.run("--no-products") == 1
    assert "data window holds no pixel" in capsys.readouterr().err


def test_a_pixel_belongs_to_the_window_that_holds_its_centre(scene):
    """Neighbouring windows neither overlap nor leave a gap."""
    scene.settings.CreateResolutionAttr(Gf.Vec2i(40, 16))
    middle = 16.5 / 40
    for name, window in (
        ("left", (0, 0, middle, 1)),
        ("right", (middle, 0, 1, 1)),
        ("low", (0, 0, 1, 5.5 / 16)),
        ("high", (0, 5.5 / 16, 1, 1)),
    ):
        scene.product(name, dataWindowNDC=Gf.Vec4f(*window))
    assert scene.run() == 0

    def window(name):
        return exr_header(scene.path(f"{name}.exr"))["dataWindow"]

    left, right, low, high = (window(name) for name in ("left", "right", "low", "high"))
    assert left[0] == 0
    assert left[2] + 1 == right[0]
    assert right[2] == 39
    assert (high[1], low[3]) == (0, 15)
    # 5.5 / 16 is exact: the centre of the sixth row from below, which is above the edge.
    assert (high[3], low[1]) == (10, 11)


def test_the_image_that_is_named_takes_shapes_only_from_named_settings(scene):
    scene.settings.CreateResolutionAttr(Gf.Vec2i(30, 15))
    scene.settings.CreateDataWindowNDCAttr(Gf.Vec4f(0, 0, 0.5, 1))
    assert scene.run(out="own.exr") == 0
    header = exr_header(scene.path("own.exr"))
    assert header["displayWindow"] == (0, 0, 29, 14)
    assert header["dataWindow"] == (0, 0, 14, 14)
    assert scene.run("-w", 20, out="own.exr") == 0
    assert exr_header(scene.path("own.exr"))["displayWindow"] == (0, 0, 19, 19)
    assert scene.run("-w", 10, out="own.exr", named=False) == 0
    assert exr_header(scene.path("own.exr"))["dataWindow"] == (0, 0, 9, 9)


def test_purposes_of_the_settings(scene):
    scene.quad.CreatePurposeAttr("render")
    assert scene.run() == 0
    assert not read_png(scene.path("own.png")).any()
    scene.settings.CreateIncludedPurposesAttr(["default", "render"])
    for named in (True, False):
        assert scene.run("-w", 10, named=named) == 0
        assert read_png(scene.path("own.png")).any()
    assert scene.run("--purposes", "guide") == 0
    assert not read_png(scene.path("own.png")).any()


# The renderer's own settings ---------------------------------------------------------------------


def own(prim, **values):
    """trapeze:NAME attributes."""
    types = {int: "Int", float: "Float", str: "Token", bool: "Bool"}
    for name, value in values.items():
        kind = getattr(Sdf.ValueTypeNames, types[type(value)])
        prim.GetPrim().CreateAttribute(f"trapeze:{name}", kind).Set(value)


def test_own_settings(scene, monkeypatch):
    seen = []
    original = hdtrapeze.render.Renderer.render
    monkeypatch.setattr(
        hdtrapeze.render.Renderer,
        "render",
        lambda self, *args: seen.append(self.options) or original(self, *args),
    )
    own(scene.settings, samples=16, shadingRate=2.0, filter="mitchell", filterWidth=3.0, seed=5)
    own(scene.settings, maxMicropolygons=1000, cameraLight=False, compression="rle", cull="back")
    product = scene.product("shot")
    own(product, samples=2, pixelType="float", compression="none")
    own(product.GetPrim(), seed=6)
    scene.flags = []
    assert scene.run("-c", "high", out="own.exr") == 0
    first, second = seen  # the image that is named comes before products
    assert (first.samples, first.shading_rate, first.seed) == (16, 1.0, 5)
    assert (first.filter, first.filter_width) == ("mitchell", 3.0)
    assert (first.max_micropolygons, first.camera_light) == (1000, False)
    assert (second.samples, second.seed, second.filter) == (2, 6, "mitchell")
    assert (first.cull, second.cull) == ("back", "back")
    assert exr_header(scene.path("own.exr"))["compression"] == "rle"
    header = exr_header(scene.path("shot.exr"))
    assert header["compression"] == "none"
    assert header["channels"]["R"] == "float"
    assert header["hdtrapeze/samples"] == 2
    seen.clear()
    scene.flags = FAST
    assert scene.run("--seed", 1, "--half", "--compression", "zips", out="own.exr") == 0
    assert [options.samples for options in seen] == [4], "flags win, so they agree"
    assert exr_header(scene.path("shot.exr"))["channels"]["R"] == "half"


def test_own_settings_that_cannot_be(scene, capsys):
    own(scene.settings, samples=0, sampels=4, filter="sharp", seed="one", cull="left")
    assert scene.run() == 0
    lines = warnings(capsys)
    assert len(lines) == 5, lines
    assert all(line.startswith("/Render/settings: trapeze:") for line in lines)
    text = "\n".join(lines)
    for words in ("samples is 0", "did you mean trapeze:samples?", "'sharp'", "'one'", "'left'"):
        assert words in text
    assert read_png(scene.path("own.png")).shape == (40, 40, 4)


def test_a_still_product_before_a_blurred_one(scene):
    """What stood still for one image moves in the next one of the same frame."""
    camera = UsdGeom.Camera.Get(scene.stage, "/main_cam")
    camera.CreateShutterCloseAttr(1.0)
    scene.stage.SetTimeCodesPerSecond(1.0)
    points = scene.quad.GetPointsAttr()
    value = points.Get()
    points.Clear()
    points.Set(value, 1)
    scene.quad.CreateVelocitiesAttr().Set([Gf.Vec3f(2, 0, 0)] * 4, 1)
    scene.settings.CreateDisableMotionBlurAttr(True)
    scene.product("blurred", disableMotionBlur=False)
    assert scene.run() == 0
    blurred = alpha(scene.path("blurred.exr"))
    assert ((blurred > 0) & (blurred < 1)).sum() > 50
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, FULL)
