"""RenderSettings, RenderProducts and RenderVars: what they say, and the files that they make."""

import hdtrapeze
import numpy as np
import pytest
from hdtrapeze.cli import main
from hdtrapeze.frames import expand_frame
from images import exr_header, read_exr, read_png
from pxr import Gf, Sdf, UsdGeom, UsdHydra, UsdRender
from scenes import add_camera, add_quad, new_stage, quad_coverage, set_samples

FAST = ["--samples", "4", "--filter", "box"]
HALF = quad_coverage(-2, -2, 2, 2, size=20)
FULL = quad_coverage(-2, -2, 2, 2)


class Scene:
    """A stage with a quad, cameras and render settings; saved before each run."""

    def __init__(self, folder):
        self.folder = folder
        self.runs = 0
        self.stage = new_stage()
        self.stage.SetStartTimeCode(1)
        add_camera(self.stage, "/main_cam")
        self.quad = add_quad(self.stage)
        self.settings = UsdRender.Settings.Define(self.stage, "/Render/settings")
        self.settings.CreateResolutionAttr(Gf.Vec2i(40, 40))
        self.var("color")

    def var(self, name, **attributes):
        """A RenderVar /Render/Vars/NAME; attributes by their USD names, __ for a colon."""
        var = UsdRender.Var.Define(self.stage, f"/Render/Vars/{name}")
        for key, value in attributes.items():
            key = key.replace("__", ":")
            attribute = var.GetPrim().GetAttribute(key)
            if not attribute:
                attribute = var.GetPrim().CreateAttribute(key, Sdf.ValueTypeNames.String)
            attribute.Set(value)
        return var

    def product(self, name, *variables, file=None, **attributes):
        """A RenderProduct /Render/NAME of the settings that writes NAME.exr."""
        product = UsdRender.Product.Define(self.stage, f"/Render/{name}")
        product.CreateProductNameAttr(str(self.folder / (file or f"{name}.exr")))
        paths = [f"/Render/Vars/{var}" for var in variables or ["color"]]
        product.CreateOrderedVarsRel().SetTargets(paths)
        for key, value in attributes.items():
            product.GetPrim().GetAttribute(key).Set(value)
        self.settings.CreateProductsRel().AddTarget(product.GetPath())
        return product

    def path(self, name):
        return self.folder / name

    def run(self, *flags, out="own.png", named=True):
        """The exit code of `record` with the settings named, or only in the stage's metadata."""
        # USD may still have the layer of the run before.
        self.runs += 1
        file = self.path(f"scene{self.runs}.usda")
        self.stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
        self.stage.GetRootLayer().Export(str(file))
        named = ["-rs", "/Render/settings"] if named and "-rp" not in flags else []
        arguments = ["record", file, self.path(out), *FAST, *named, *flags]
        try:
            return main([str(argument) for argument in arguments])
        except SystemExit as stop:
            return stop.code


@pytest.fixture
def scene(tmp_path):
    return Scene(tmp_path)


def warnings(capsys):
    """Lines of stderr; fails where there is anything but warnings."""
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("warning: ") for line in lines), lines
    return [line.removeprefix("warning: ") for line in lines]


def one(capsys, path, *words):
    """Asserts that there was one warning, about `path`, with `words` in it."""
    lines = warnings(capsys)
    assert len(lines) == 1, lines
    assert lines[0].startswith(f"{path}: "), lines
    for word in words:
        assert word in lines[0], lines


def alpha(path):
    return np.asarray(read_exr(path)["A"], np.float32)


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
    assert counted == [["color", "depth", "primId"], ["color"]]
    assert set(exr_header(scene.path("b.exr"))["channels"]) == {"ids.X"}
    assert set(exr_header(scene.path("a.exr"))["channels"]) == {*"RGBA", "depth.Z"}
    counted.clear()
    assert scene.run("-w", 30, "--no-motion-blur") == 0
    assert len(counted) == 3


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
    assert scene.run() == 0
    one(capsys, "/Render/shot", "holds no pixel", "Not written")
    assert alpha(scene.path("good.exr")).any()
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
    own(scene.settings, maxMicropolygons=1000, cameraLight=False, compression="rle")
    product = scene.product("shot")
    own(product, samples=2, pixelType="float", compression="none")
    own(product.GetPrim(), seed=6)
    FAST_FLAGS = FAST.copy()
    FAST.clear()
    try:
        assert scene.run("-c", "high", out="own.exr") == 0
    finally:
        FAST.extend(FAST_FLAGS)
    first, second = seen
    assert (first.samples, first.shading_rate, first.seed) == (16, 1.0, 5)
    assert (first.filter, first.filter_width) == ("mitchell", 3.0)
    assert (first.max_micropolygons, first.camera_light) == (1000, False)
    assert (second.samples, second.seed, second.filter) == (2, 6, "mitchell")
    assert exr_header(scene.path("own.exr"))["compression"] == "rle"
    header = exr_header(scene.path("shot.exr"))
    assert header["compression"] == "none"
    assert header["channels"]["R"] == "float"
    assert header["hdtrapeze/samples"] == 2
    seen.clear()
    assert scene.run("--seed", 1, "--half", "--compression", "zips", out="own.exr") == 0
    assert [options.samples for options in seen] == [4], "flags win, so they agree"
    assert exr_header(scene.path("shot.exr"))["channels"]["R"] == "half"


def test_own_settings_that_cannot_be(scene, capsys):
    own(scene.settings, samples=0, sampels=4, filter="sharp", seed="one", shadingRate=-1.0)
    assert scene.run() == 0
    lines = warnings(capsys)
    assert len(lines) == 5, lines
    assert all(line.startswith("/Render/settings: trapeze:") for line in lines)
    text = "\n".join(lines)
    for words in ("samples is 0", "did you mean trapeze:samples?", "'sharp'", "'one'", "-1.0"):
        assert words in text
    assert read_png(scene.path("own.png")).shape == (40, 40, 4)


# What is wrong -----------------------------------------------------------------------------------


def test_vars_without_an_aov_are_left_out(scene, capsys):
    scene.var("diffuse", sourceName="C<RD>[<L.>O]", sourceType="lpe")
    scene.var("whole", sourceName="C.*[<L.>O]", sourceType="lpe")
    scene.var("none", sourceName="nonsense")
    scene.product("shot", "diffuse", "whole", "none", "nobody")
    assert scene.run() == 0
    lines = warnings(capsys)
    assert sorted(line.split(": ")[0] for line in lines) == [
        *("/Render/Vars/diffuse", "/Render/Vars/none", "/Render/shot")
    ]
    assert any("/Render/Vars/nobody" in line for line in lines)
    assert set(exr_header(scene.path("shot.exr"))["channels"]) == set("RGBA")


def test_a_product_without_vars_holds_color(scene, capsys):
    product = scene.product("shot")
    product.GetOrderedVarsRel().ClearTargets(True)
    assert scene.run() == 0
    one(capsys, "/Render/shot", "orderedVars is empty", "color is written")
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")), FULL)


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (lambda p, s: p.GetProductNameAttr().Clear(), "no productName"),
        (lambda p, s: p.GetProductNameAttr().Set("shot.tif"), "must end in .exr or .png"),
        (lambda p, s: p.CreateProductTypeAttr("deepRaster"), "deepRaster is not supported"),
        (lambda p, s: p.CreateCameraRel().SetTargets(["/quad"]), "/quad is no camera"),
        (lambda p, s: p.CreateCameraRel().SetTargets(["/nobody"]), "/nobody is no camera"),
        (lambda p, s: p.GetProductNameAttr().Set(str(s.path("good.exr"))), "already written by"),
    ],
)
def test_faulty_products_are_left_out(scene, capsys, break_it, words):
    scene.product("good")
    break_it(scene.product("shot"), scene)
    assert scene.run() == 0
    one(capsys, "/Render/shot", words)
    assert alpha(scene.path("good.exr")).any()
    assert not scene.path("shot.exr").exists()
    assert scene.path("own.png").exists()


def test_products_that_cannot_be_written_end_in_exit_code_3(scene, capsys):
    scene.product("good")
    scene.product("lost", file="nowhere/lost.exr")
    assert scene.run() == 3
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2, lines
    assert lines[0].startswith("warning: /Render/lost: The folder ")
    assert lines[1] == "error: A render product was not written: /Render/lost."
    assert alpha(scene.path("good.exr")).any()
    assert scene.path("own.png").exists()


def test_a_product_takes_the_place_of_the_image_of_its_name(scene, capsys):
    scene.var("depth")
    scene.product("own", "color", "depth")
    assert scene.run(out="own.exr") == 0
    assert "depth.Z" in exr_header(scene.path("own.exr"))["channels"]
    lines = warnings(capsys)
    assert len(lines) == 1, lines
    assert "already written by /Render/own" in lines[0]


def test_targets_that_are_no_products(scene, capsys):
    scene.product("good")
    scene.settings.GetProductsRel().AddTarget("/quad")
    assert scene.run() == 0
    one(capsys, "/Render/settings", "products names /quad", "no RenderProduct")
    assert scene.path("good.exr").exists()


def test_relationships_that_lead_in_a_circle(scene, capsys):
    scene.settings.CreateProductsRel().SetTargets(["/Render/settings.camera"])
    scene.settings.CreateCameraRel().SetTargets(["/Render/settings.products"])
    assert scene.run() == 0
    lines = warnings(capsys)
    assert len(lines) == 2, lines
    assert all(line.startswith("/Render/settings: ") for line in lines)
    assert scene.path("own.png").exists()


def test_relationships_through_relationships(scene):
    add_camera(scene.stage, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    indirect = scene.stage.GetPrimAtPath("/quad").CreateRelationship("shot:camera")
    indirect.SetTargets(["/wide"])
    scene.settings.CreateCameraRel().SetTargets(["/quad.shot:camera"])
    assert scene.run() == 0
    own = read_png(scene.path("own.png"))[..., 3] / 255.0
    np.testing.assert_array_equal(own, quad_coverage(-1, -1, 1, 1))


def test_several_cameras_are_one_warning(scene, capsys):
    add_camera(scene.stage, "/wide", horizontalAperture=40.0, verticalAperture=40.0)
    scene.settings.CreateCameraRel().SetTargets(["/wide", "/main_cam"])
    assert scene.run() == 0
    one(capsys, "/Render/settings", "camera has 2 targets", "/wide")


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("resolution", Gf.Vec2i(0, 20), "(0, 20)"),
        ("resolution", Gf.Vec2i(20, 1 << 20), "65536"),
        ("pixelAspectRatio", -1.0, "above 0"),
        ("pixelAspectRatio", float("nan"), "above 0"),
        ("aspectRatioConformPolicy", "stretch", "adjustPixelAspectRatio"),
        ("dataWindowNDC", Gf.Vec4f(0.5, 0, 0.5, 1), "xmin < xmax"),
        ("includedPurposes", ["render", "everything"], "everything"),
        ("renderingColorSpace", "lin_ap1_scene", "linear Rec. 709"),
    ],
)
def test_values_that_cannot_be_fall_back(scene, capsys, attribute, value, words):
    scene.settings.GetPrim().GetAttribute(attribute).Set(value)
    assert scene.run("-w", 40, "--no-products") == 0
    one(capsys, "/Render/settings", words)
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, FULL)


def test_attributes_of_other_types(scene, capsys):
    file = scene.path("wrong.usda")
    scene.var("depth")
    scene.product("shot", "color", "depth", resolution=Gf.Vec2i(40, 40))
    scene.stage.GetRootLayer().Export(str(file))
    layer = Sdf.Layer.FindOrOpen(str(file))
    for path, kind, value in (
        ("/Render/settings.resolution", Sdf.ValueTypeNames.String, "large"),
        ("/Render/settings.disableMotionBlur", Sdf.ValueTypeNames.String, "yes"),
        ("/Render/Vars/depth.sourceName", Sdf.ValueTypeNames.Int, 3),
    ):
        spec = layer.GetPrimAtPath(Sdf.Path(path).GetPrimPath())
        if path in (str(p.path) for p in spec.properties):
            spec.RemoveProperty(layer.GetPropertyAtPath(path))
        Sdf.AttributeSpec(spec, Sdf.Path(path).name, kind).default = value
    layer.Save()
    out = scene.path("own.png")
    flags = ["-rs", "/Render/settings", "-w", "40"]
    assert main(["record", str(file), str(out), *FAST, *flags]) == 0
    lines = warnings(capsys)
    assert len(lines) == 3, lines
    for path, word in (
        ("/Render/settings", "'large'"),
        ("/Render/settings", "'yes'"),
        ("/Render/Vars/depth", "sourceName is 3"),
    ):
        assert any(line.startswith(f"{path}: ") and word in line for line in lines), lines
    assert "depth.Z" in exr_header(scene.path("shot.exr"))["channels"]


def test_masks_that_leave_settings_out(scene, capsys):
    scene.product("shot")
    assert scene.run("--mask", "/quad,/main_cam") == 1
    assert "--mask leaves it out" in capsys.readouterr().err
    assert scene.run("--mask", "/quad,/main_cam,/Render/settings") == 0
    one(capsys, "/Render/settings", "/Render/shot", "--mask leaves out")


# Passes ------------------------------------------------------------------------------------------


def test_passes_of_the_command(scene, capsys):
    render_pass = UsdRender.Pass.Define(scene.stage, "/Render/pass")
    render_pass.CreateRenderSourceRel().SetTargets(["/Render/settings"])
    scene.product("shot")
    prim = render_pass.GetPrim()
    prim.GetRelationship("collection:matte:includes").SetTargets(["/quad"])
    assert scene.run("-rp", "/Render/pass") == 0
    assert warnings(capsys) == []
    assert not alpha(scene.path("shot.exr")).any()
    assert exr_header(scene.path("shot.exr"))["hdtrapeze/renderPass"] == "/Render/pass"


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda p: p.GetRenderSourceRel().SetTargets([]), 1, "has no renderSource"),
        (lambda p: p.GetRenderSourceRel().SetTargets(["/quad"]), 1, "not a RenderSettings"),
        (lambda p: p.GetRenderSourceRel().SetTargets(["/nobody"]), 1, "not a RenderSettings"),
        (lambda p: p.CreateFileNameAttr("shot.nk"), 1, "shot.nk"),
        (
            lambda p: p.GetRenderSourceRel().SetTargets(["/Render/settings", "/quad"]),
            0,
            "warning: /Render/pass: has several render sources; using /Render/settings",
        ),
        (
            lambda p: p.GetRenderSourceRel().SetTargets(["/Render/pass.renderSource"]),
            1,
            "no renderSource",
        ),
    ],
)
def test_sources_of_passes(scene, capsys, change, code, words):
    render_pass = UsdRender.Pass.Define(scene.stage, "/Render/pass")
    render_pass.CreateRenderSourceRel().SetTargets(["/Render/settings"])
    change(render_pass)
    assert scene.run("-rp", "/Render/pass") == code
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    assert words in lines[0]


def test_a_pass_for_another_renderer(scene, capsys):
    render_pass = UsdRender.Pass.Define(scene.stage, "/Render/pass")
    render_pass.CreateRenderSourceRel().SetTargets(["/Render/settings"])
    api = UsdHydra.RenderPassAPI.Apply(render_pass.GetPrim())
    api.CreateHydraRendererNameAttr("Storm")
    assert scene.run("-rp", "/Render/pass") == 0
    one(capsys, "/Render/pass", "Storm")
    assert scene.run("-rp", "/Render/pass", "--renderer", "Trapeze") == 0
    assert warnings(capsys) == []
    api.GetHydraRendererNameAttr().Set("Trapeze")
    assert scene.run("-rp", "/Render/pass") == 0
    assert warnings(capsys) == []


def test_partial_products_of_an_interrupted_render(scene, monkeypatch, capsys):
    scene.product("shot")
    original = hdtrapeze.render.Renderer.render

    def interrupted(self, *args):
        original(self, *args)
        raise hdtrapeze.errors.Interrupted("Interrupted.")

    monkeypatch.setattr(hdtrapeze.render.Renderer, "render", interrupted)
    assert scene.run() == 130
    assert {p.name for p in scene.folder.iterdir()} == {
        *("scene1.usda", "own.partial.png", "shot.partial.exr")
    }
    assert exr_header(scene.path("shot.partial.exr"))["hdtrapeze/complete"] == "false"
    assert "shot.partial.exr" in capsys.readouterr().err


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
