"""RenderSettings, products, vars and passes that are faulty: one warning each, the rest renders."""

import hdtrapeze
import numpy as np
import pytest
from hdtrapeze.cli import main
from images import exr_header, read_png
from pxr import Gf, Sdf, UsdHydra, UsdRender
from scenes import add_camera, quad_coverage
from usdrender_scene import FAST, FULL, Scene, alpha, one, warnings


@pytest.fixture
def scene(tmp_path):
    return Scene(tmp_path)


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


def test_a_primvar_that_no_prim_has_is_told_and_left_empty(scene, capsys):
    scene.var("wear", sourceName="wear", sourceType="primvar", dataType="float")
    scene.product("shot", "color", "wear")
    assert scene.run("-f", "1:2", out="own.#.png") == 0
    lines = warnings(capsys)
    assert sum("wear" in line and "no prim has such a primvar" in line for line in lines) == 1, (
        lines
    )
    assert set(exr_header(scene.path("shot.exr"))["channels"]) >= set("RGBA")


def test_a_product_without_vars_holds_color(scene, capsys):
    product = scene.product("shot")
    product.GetOrderedVarsRel().ClearTargets(True)
    assert scene.run() == 0
    one(capsys, "/Render/shot", "orderedVars is empty", "color is written")
    np.testing.assert_array_equal(alpha(scene.path("shot.exr")), FULL)


@pytest.mark.parametrize(
    ("break_it", "words", "code"),
    [
        (lambda p, s: p.GetProductNameAttr().Clear(), "no productName", 1),
        (
            lambda p, s: p.GetProductNameAttr().Set("shot.tif"),
            "must be one that ends in .exr or .png",
            1,
        ),
        (lambda p, s: p.CreateProductTypeAttr("deepRaster"), "deepRaster is not supported", 0),
        (lambda p, s: p.CreateCameraRel().SetTargets(["/quad"]), "/quad is no camera", 1),
        (lambda p, s: p.CreateCameraRel().SetTargets(["/nobody"]), "/nobody is no camera", 1),
        (lambda p, s: p.GetProductNameAttr().Set(str(s.path("good.exr"))), "already written by", 1),
        (lambda p, s: p.GetOrderedVarsRel().SetTargets(["/quad"]), "none of its vars", 1),
    ],
)
def test_faulty_products_are_left_out(scene, capsys, break_it, words, code):
    scene.product("good")
    break_it(scene.product("shot"), scene)
    assert scene.run() == code
    if "vars" in words:  # and the one that is no var
        assert sum(words in line for line in warnings(capsys)) == 1
    else:
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
    assert lines[0].startswith("warning: /Render/lost: the folder ")
    assert lines[1] == "error: Not everything was written: /Render/lost."
    assert alpha(scene.path("good.exr")).any()
    assert scene.path("own.png").exists()


def test_a_product_that_fails_at_the_last_moment(scene, capsys):
    scene.product("lost", file="x" * 300 + ".exr")
    scene.product("good")
    assert scene.run() == 3
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2, lines
    assert lines[0].startswith("warning: /Render/lost: ")
    assert lines[1] == "error: Not everything was written: /Render/lost."
    assert alpha(scene.path("good.exr")).any()
    assert scene.path("own.png").exists()


def test_folders_that_are_not_writable_are_found_before_the_first_ray(scene, monkeypatch, capsys):
    scene.product("lost", file="/proc/lost.exr", resolution=Gf.Vec2i(20, 20))
    rendered = []
    original = hdtrapeze.render.Renderer.render

    def render(self, *args):
        rendered.append(self.resolution)
        original(self, *args)

    monkeypatch.setattr(hdtrapeze.render.Renderer, "render", render)
    assert scene.run() == 3
    one(capsys, "/Render/lost", "the folder /proc is not writable; it is not written")
    assert rendered == [(40, 40)]


def test_a_render_that_fails_does_not_end_the_others(scene, monkeypatch, capsys):
    for name, size in (("bad", 20), ("good", 30)):
        scene.product(name, resolution=Gf.Vec2i(size, size))
    original = hdtrapeze.render.Renderer.render
    broken = 20

    def render(self, *args):
        if self.resolution[0] == broken:
            raise hdtrapeze.errors.SceneError("The render failed.")
        original(self, *args)

    monkeypatch.setattr(hdtrapeze.render.Renderer, "render", render)
    assert scene.run() == 1
    one(capsys, "/Render/bad", "The render failed; it is not written")
    names = {path.name for path in scene.folder.iterdir()}
    assert names == {"scene1.usda", "own.png", "good.exr"}
    broken = 40
    assert scene.run(out="again.png") == 1
    assert capsys.readouterr().err == "error: Frame 1: The render failed.\n"
    assert scene.path("bad.exr").exists() and not scene.path("again.png").exists()


def test_what_ends_the_command_in_a_product_leaves_the_image_that_is_named(scene, monkeypatch):
    scene.product("shot", resolution=Gf.Vec2i(20, 20))
    original = hdtrapeze.render.Renderer.render

    def render(self, *args):
        original(self, *args)
        if self.resolution == (20, 20):
            raise hdtrapeze.errors.Interrupted("Interrupted.")

    monkeypatch.setattr(hdtrapeze.render.Renderer, "render", render)
    assert scene.run() == 130
    assert scene.path("own.png").exists()


def test_a_product_takes_the_place_of_the_image_of_its_name(scene, capsys):
    scene.var("depth")
    scene.product("own", "color", "depth")
    assert scene.run(out="own.exr") == 1
    assert "depth.Z" in exr_header(scene.path("own.exr"))["channels"]
    lines = warnings(capsys)
    assert len(lines) == 1, lines
    assert "already written by /Render/own" in lines[0]


def test_targets_that_are_no_products(scene, capsys):
    scene.product("good")
    scene.settings.GetProductsRel().AddTarget("/quad")
    assert scene.run() == 1
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
        ("resolution", Gf.Vec2i(0, 20), "(2048, 1080) is used"),
        ("resolution", Gf.Vec2i(20, 1 << 20), "65536"),
        ("resolution", Gf.Vec2i(0, 0), "(0, 0), which cannot be"),
        ("pixelAspectRatio", 0.0, "is 0, which cannot be"),
        ("aspectRatioConformPolicy", "", "is empty, which cannot be"),
        ("dataWindowNDC", Gf.Vec4f(0, 0, 0, 0), "is (0, 0, 0, 0), which cannot be"),
        ("pixelAspectRatio", -1.0, "from 0.001 to 1000"),
        ("pixelAspectRatio", 1e30, "from 0.001 to 1000"),
        ("aspectRatioConformPolicy", "stretch", "adjustPixelAspectRatio; expandAperture is used"),
        ("dataWindowNDC", Gf.Vec4f(0.5, 0, 0.5, 1), "xmin < xmax and ymin < ymax; (0, 0, 1, 1) is"),
        ("includedPurposes", ["render", "everything"], "is [render, everything], which"),
        ("dataWindowNDC", Gf.Vec4f(float("nan"), 0, 1, 1), "is (NaN, 0, 1, 1), which"),
        ("renderingColorSpace", "lin_ap1_scene", "linear Rec. 709"),
    ],
)
def test_values_that_cannot_be_fall_back(scene, capsys, attribute, value, words):
    scene.settings.GetPrim().GetAttribute(attribute).Set(value)
    assert scene.run("-w", 40, "--no-products") == 0
    one(capsys, "/Render/settings", words)
    np.testing.assert_array_equal(read_png(scene.path("own.png"))[..., 3] / 255.0, FULL)


def test_a_products_values_that_cannot_be_are_the_settings(scene, capsys):
    scene.settings.CreateDataWindowNDCAttr(Gf.Vec4f(0, 0, 0.5, 1))
    scene.product("shot", dataWindowNDC=Gf.Vec4f(0.5, 0, 0.5, 1), resolution=Gf.Vec2i(40, 40))
    assert scene.run("-w", 40) == 0
    one(capsys, "/Render/shot", "dataWindowNDC is (0.5, 0, 0.5, 1)", "; (0, 0, 0.5, 1) is used")
    assert exr_header(scene.path("shot.exr"))["dataWindow"] == (0, 0, 19, 39)


def test_own_settings_that_cannot_be(scene, capsys):
    prim = scene.settings.GetPrim()
    samples = prim.CreateAttribute("trapeze:samples", Sdf.ValueTypeNames.Float)
    samples.Set(4.0)
    assert scene.run("-w", 40, "--no-products") == 0
    words = "trapeze:samples is 4, which cannot be: it must be a whole number, and is of the type"
    one(capsys, "/Render/settings", f"{words} float; 64 is used")
    samples.Block()
    assert scene.run("-w", 40, "--no-products") == 0
    assert warnings(capsys) == []


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
        ("/Render/settings", "resolution has the type string, where int2"),
        ("/Render/settings", "disableMotionBlur has the type string"),
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


def test_paths_that_are_not_absolute(scene, capsys):
    assert scene.run("-rs", "Render/settings", named=False) == 2
    text = capsys.readouterr().err
    assert "'Render/settings' must be an absolute path, such as /Render/settings" in text
    scene.stage.SetMetadata("renderSettingsPrimPath", "Render/settings")
    file = scene.path("relative.usda")
    scene.stage.GetRootLayer().Export(str(file))
    assert main(["record", str(file), str(scene.path("own.png")), *FAST]) == 0
    one(capsys, "/", "Render/settings, which is no absolute path")


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
