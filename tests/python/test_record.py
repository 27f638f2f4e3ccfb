"""The command: files, flags, messages and exit codes."""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import hdtrapeze.request
import numpy as np
import pytest
from hdtrapeze.cli import main
from hdtrapeze.flags import add_record_flags
from images import exr_header, read_png
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdRender
from scenes import add_camera, add_cube, add_quad, new_stage, quad_coverage, set_samples

SMALL = ["-w", "40", "--samples", "4", "--filter", "box"]


@pytest.fixture
def scene(tmp_path):
    """Path of a small stage with a moving quad and the primary camera."""
    stage = new_stage()
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(4)
    add_camera(stage, "/main_cam")
    quad = add_quad(stage)
    keys = {1: Gf.Vec3d(0), 3: Gf.Vec3d(2, 0, 0)}
    set_samples(quad.AddTranslateOp().GetAttr(), keys)
    path = tmp_path / "scene.usda"
    stage.GetRootLayer().Export(str(path))
    return str(path)


def run(*arguments):
    """The exit code of the command, run in this process."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as stop:
        return stop.code


def alpha(path):
    return read_png(path)[..., 3] / 255.0


def test_exr(scene, tmp_path, capsys):
    out = tmp_path / "out.exr"
    assert run("record", scene, out, *SMALL, "--seed", 9) == 0
    header = exr_header(out)
    assert set(header["channels"]) >= {"R", "G", "B", "A"}
    assert header["channels"]["R"] == "half"
    assert header["compression"] == "zip"
    assert header["dataWindow"] == (0, 0, 39, 39)
    text = capsys.readouterr()
    assert "/main_cam" in text.out
    assert str(out) in text.out
    assert text.err == ""  # no progress bar, no warnings
    names = {name.split("/")[-1]: value for name, value in header.items() if "hdtrapeze" in name}
    assert names["camera"] == "/main_cam"
    assert float(names["frame"]) == 1
    assert int(names["samples"]) == 4
    assert int(names["samplesDone"]) == 4
    assert int(names["seed"]) == 9
    assert names["complete"] == "true"
    assert names["stage"].endswith("scene.usda")
    assert json.loads(names["settings"])["filter"] == "box"
    assert json.loads(names["timings"])["total_seconds"] > 0


def test_aovs_and_pixel_types(scene, tmp_path):
    out = tmp_path / "out.exr"
    flags = ["--aov", "depth", "--aov", "primId", "--float", "--compression", "piz"]
    assert run("record", scene, out, *SMALL, *flags) == 0
    header = exr_header(out)
    header = header if isinstance(header, dict) else {k: v for p in header for k, v in p.items()}
    assert header["compression"] == "piz"
    channels = header["channels"]
    assert any("depth" in name for name in channels), channels
    assert any("primId" in name for name in channels), channels
    assert "half" not in channels.values()


def test_png_is_srgb_unless_told_otherwise(scene, tmp_path):
    out = tmp_path / "out.png"
    assert run("record", scene, out, *SMALL, "-f", 1) == 0
    encoded = read_png(out)
    np.testing.assert_array_equal(encoded[..., 3] / 255.0, quad_coverage(-2, -2, 2, 2))
    assert run("record", scene, out, *SMALL, "-color", "disabled") == 0
    linear = read_png(out)
    value = 15000 * 2 * (1 - np.cos(np.radians(0.53 / 2)))
    assert linear[20, 20, 0] == pytest.approx(255 * value, abs=1)
    assert encoded[20, 20, 0] == pytest.approx(255 * (1.055 * value ** (1 / 2.4) - 0.055), abs=1)


def test_frames(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "f.##.png", *SMALL, "--frames", "1:3") == 0
    for frame, x in ((1, 0), (2, 1), (3, 2)):
        np.testing.assert_array_equal(
            alpha(tmp_path / f"f.{frame:02}.png"), quad_coverage(x - 2, -2, x + 2, 2)
        )
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert run("record", scene, tmp_path / "g.#.#.png", *SMALL, "-f", "1:2x0.5") == 0
    assert {p.name for p in tmp_path.glob("g.*")} == {"g.1.0.png", "g.1.5.png", "g.2.0.png"}


def test_first_frame_is_the_stages_and_default_time_is_apart(scene, tmp_path):
    out = tmp_path / "a.png"
    assert run("record", scene, out, *SMALL) == 0
    np.testing.assert_array_equal(alpha(out), quad_coverage(-2, -2, 2, 2))
    assert run("record", scene, out, *SMALL, "--defaultTime") == 0
    np.testing.assert_array_equal(alpha(out), quad_coverage(-2, -2, 2, 2))


def test_shutter_flags(scene, tmp_path):
    out = tmp_path / "a.png"
    assert run("record", scene, out, *SMALL, "--shutter", 0, 2) == 0
    soft = alpha(out)
    assert ((soft > 0) & (soft < 1)).sum() > 50
    assert run("record", scene, out, *SMALL, "--shutter", 1, 2, "--no-motion-blur") == 0
    np.testing.assert_array_equal(alpha(out), quad_coverage(-2, -2, 2, 2))


def test_mask_session_layer_and_purposes(scene, tmp_path):
    out = tmp_path / "a.png"
    assert run("record", scene, out, *SMALL, "--mask", "/main_cam") == 0
    assert not alpha(out).any()
    session = Sdf.Layer.CreateNew(str(tmp_path / "session.usda"))
    session.ImportFromString('#usda 1.0\nover "quad"\n{\n    uniform token purpose = "render"\n}\n')
    session.Save()
    flags = ["--sessionLayer", session.realPath]
    assert run("record", scene, out, *SMALL, *flags) == 0
    assert not alpha(out).any()
    assert run("record", scene, out, *SMALL, *flags, "--purposes", "render,guide") == 0
    assert alpha(out).any()


def test_crop_in_pixels_and_fractions(scene, tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    assert run("record", scene, a, *SMALL, "--crop", 10, 0, 20, 40) == 0
    assert run("record", scene, b, *SMALL, "--crop", "0.25", "0.0", "0.5", "1.0") == 0
    np.testing.assert_array_equal(read_png(a), read_png(b))
    expected = quad_coverage(-2, -2, 2, 2)
    expected[:, 20:] = 0
    np.testing.assert_array_equal(alpha(a), expected)


def test_render_settings(scene, tmp_path, capsys):
    stage = Usd.Stage.Open(scene)
    add_camera(stage, "/other", horizontalAperture=40.0)
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateCameraRel().SetTargets([Sdf.Path("/other")])
    settings.CreateResolutionAttr(Gf.Vec2i(60, 30))
    product = UsdRender.Product.Define(stage, "/Render/product")
    settings.CreateProductsRel().SetTargets([product.GetPath()])
    render_pass = UsdRender.Pass.Define(stage, "/Render/pass")
    render_pass.CreateRenderSourceRel().SetTargets([settings.GetPath()])
    path = tmp_path / "settings.usda"
    stage.GetRootLayer().Export(str(path))
    out = tmp_path / "a.png"
    for flags in (["-rs", "/Render/settings"], ["-rp", "/Render/pass"]):
        assert run("record", path, out, "--samples", 1, *flags) == 1
        text = capsys.readouterr()
        assert "/other" in text.out
        assert "warning: /Render/product: it has no productName" in text.err
        assert read_png(out).shape == (30, 60, 4)
    assert run("record", path, out, "--samples", 1, "-rs", "/Render/settings", "-w", 20) == 1
    assert read_png(out).shape == (10, 20, 4)
    assert run("record", path, out, "--samples", 1, "-rs", "/Render/none") == 1
    assert "/Render/none" in capsys.readouterr().err


def test_relative_paths_of_cameras(tmp_path, capsys):
    stage = new_stage()
    add_camera(stage, "/Cameras/main_cam")
    add_camera(stage, "/Other/main_cam")
    add_cube(stage)
    path = tmp_path / "scene.usda"
    stage.GetRootLayer().Export(str(path))
    for name, code, word in (
        ("main_cam", 0, "/Cameras/main_cam"),
        ("Other/main_cam", 0, "/Other/main_cam"),
        ("ther/main_cam", 1, "has a path that ends in ther/main_cam"),
        ("Wrong/Path/main_cam", 1, "has a path that ends in Wrong/Path/main_cam"),
    ):
        assert run("record", path, tmp_path / "a.png", *SMALL, "-cam", name) == code
        text = capsys.readouterr()
        assert word in text.out + text.err


USDRECORD_FLAGS = [
    "--mask",
    "--purposes",
    "--sessionLayer",
    "--disableGpu",
    "--disableDrawMode",
    "--disableCameraLight",
    "--resolverContext",
    "--camera",
    "-cam",
    "--defaultTime",
    "-d",
    "--frames",
    "-f",
    "--complexity",
    "-c",
    "--colorCorrectionMode",
    "-color",
    "--renderer",
    "-r",
    "--imageWidth",
    "-w",
    "--enableDomeLightVisibility",
    "--renderPassPrimPath",
    "-rp",
    "--renderSettingsPrimPath",
    "-rs",
    "--traceToFile",
    "--traceFormat",
    "--memstats",
    "--abortOnError",
]


def test_every_flag_of_usdrecord_is_known():
    parser = argparse.ArgumentParser()
    add_record_flags(parser)
    assert [flag for flag in USDRECORD_FLAGS if flag not in parser._option_string_actions] == []


def test_resolver_context(scene, tmp_path):
    for context in ("root", "inherit"):
        out = tmp_path / f"{context}.png"
        assert run("record", scene, out, *SMALL, "--resolverContext", context) == 0
        assert alpha(out).any()
    assert run("record", scene, out, *SMALL, "--resolverContext", "none") == 2


def test_an_unforeseen_fault_is_one_line(scene, tmp_path, capsys, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("first line\nsecond line")

    monkeypatch.setattr("hdtrapeze.record.open_stage", fail)
    assert run("record", scene, tmp_path / "a.png") == 1
    assert capsys.readouterr().err == "error: ZeroDivisionError: first line\n"
    assert run("record", scene, tmp_path / "a.png", "--verbose") == 1
    assert "Traceback" in capsys.readouterr().err


def break_composition(scene, tmp_path, kind):
    """The scene with one fault of composition; its path and the prim that is to be named."""
    layer = Sdf.Layer.FindOrOpen(scene)
    path = tmp_path / f"{kind}.usda"
    prim = Sdf.CreatePrimInLayer(layer, "/refers")
    prim.specifier = Sdf.SpecifierDef
    if kind == "missing":
        prim.referenceList.Prepend(Sdf.Reference("./none.usda", "/x"))
    elif kind == "broken":
        (tmp_path / "bad.usda").write_text('#usda 1.0\ndef Mesh "x" {{{')
        prim.referenceList.Prepend(Sdf.Reference("./bad.usda", "/x"))
    elif kind == "cycle":
        prim.referenceList.Prepend(Sdf.Reference("", "/refers/below"))
    else:
        layer.subLayerPaths.append("./none.usda")
    layer.Export(str(path))
    return path, "/" if kind == "sublayer" else "/refers"


@pytest.mark.parametrize("kind", ["missing", "broken", "cycle", "sublayer"])
def test_composition_errors_are_one_warning_and_abort_on_error(scene, tmp_path, capfd, kind):
    path, prim = break_composition(scene, tmp_path, kind)
    out = tmp_path / "a.png"
    assert run("record", path, out, *SMALL, "--abortOnError") == 1
    assert not out.exists()
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith(f"warning: {prim}: "), lines
    assert "abortOnError" in lines[1]
    assert run("record", path, out, *SMALL) == 0
    assert capfd.readouterr().err.splitlines() == lines[:1]
    np.testing.assert_array_equal(alpha(out), quad_coverage(-2, -2, 2, 2))


def test_messages_of_usd_go_through_the_log(scene, tmp_path, capfd):
    def fail(*_):
        Tf.Warn("two\nlines")
        return original(*_)

    original = hdtrapeze.request.find_camera
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hdtrapeze.request.find_camera", fail)
        assert run("record", scene, tmp_path / "a.png", *SMALL) == 0
        assert capfd.readouterr().err == "warning: two lines\n"


def test_a_transform_op_that_is_missing_names_its_prim(scene, tmp_path, capfd):
    stage = Usd.Stage.Open(scene)
    stage.GetPrimAtPath("/quad").RemoveProperty("xformOp:translate")
    path = tmp_path / "missing_op.usda"
    stage.GetRootLayer().Export(str(path))
    assert run("record", path, tmp_path / "a.png", *SMALL) == 0
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("warning: /quad: Unable to get attribute"), lines


def test_masks_that_match_nothing(scene, tmp_path, capsys):
    out = tmp_path / "a.png"
    assert run("record", scene, out, *SMALL, "--mask", "/main_cam,/nobody") == 0
    lines = capsys.readouterr().err.splitlines()
    assert "warning: /nobody: --mask names it, but there is no such prim" in lines
    assert "warning: the stage has nothing to render for the purposes asked for" in lines
    assert len(lines) == 2
    assert run("record", scene, out, *SMALL, "--mask", "") == 0
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(alpha(out), quad_coverage(-2, -2, 2, 2))


def test_a_mask_without_the_render_settings_is_silent(scene, tmp_path, capsys):
    stage = Usd.Stage.Open(scene)
    UsdRender.Settings.Define(stage, "/Render/settings")
    stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
    path = tmp_path / "settings.usda"
    stage.GetRootLayer().Export(str(path))
    assert run("record", path, tmp_path / "a.png", *SMALL, "--mask", "/quad,/main_cam") == 0
    assert capsys.readouterr().err == ""
    stage.SetMetadata("renderSettingsPrimPath", "/Render/nobody")
    path = tmp_path / "nobody.usda"
    stage.GetRootLayer().Export(str(path))
    assert run("record", path, tmp_path / "a.png", *SMALL) == 0
    assert "it is no RenderSettings prim" in capsys.readouterr().err


def test_the_stages_render_settings_name_the_camera(scene, tmp_path, capsys):
    stage = Usd.Stage.Open(scene)
    add_camera(stage, "/other")
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateCameraRel().SetTargets([Sdf.Path("/other")])
    stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
    path = tmp_path / "settings.usda"
    stage.GetRootLayer().Export(str(path))
    assert run("record", path, tmp_path / "a.png", *SMALL) == 0
    assert "Camera: /other" in capsys.readouterr().out


def test_a_trace_that_cannot_be_written_is_refused_first(scene, tmp_path, capsys):
    out = tmp_path / "a.png"
    for trace in (tmp_path / "none" / "trace.json", tmp_path):
        assert run("record", scene, out, *SMALL, "--traceToFile", trace) == 3
        text = capsys.readouterr()
        assert text.out == ""
        assert len(text.err.splitlines()) == 1
        assert not out.exists()


def test_a_failing_frame_is_named(scene, tmp_path, capsys):
    stage = Usd.Stage.Open(scene)
    UsdGeom.TetMesh.Define(stage, "/ball").CreateVisibilityAttr()
    visibility = UsdGeom.Imageable.Get(stage, "/ball").GetVisibilityAttr()
    set_samples(visibility, {1: "invisible", 2: "inherited"})
    path = tmp_path / "late.usda"
    stage.GetRootLayer().Export(str(path))
    flags = ["-f", "1:3", "--abortOnError"]
    assert run("record", path, tmp_path / "f.##.png", *SMALL, *flags) == 1
    assert "error: Frame 2: Stopped at the first warning" in capsys.readouterr().err
    assert {p.name for p in tmp_path.glob("f.*")} == {"f.01.png"}


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--samples", "0"], "Samples cannot be 0: it must be from 1 to 1048576."),
        (["--samples", "many"], "--samples"),
        (["--shutter", "0.5", "0.1"], "before it opens"),
        (["--shutter", "0.5"], "--shutter"),
        (["--renderer", "Storm"], "one renderer, Trapeze"),
        (["-color", "openColorIO"], "openColorIO is not supported yet"),
        (["--filter", "sharp"], "--filter"),
        (["--crop", "10", "10", "5", "5"], "crop"),
        (["--purposes", "everything"], "everything"),
        (["--sampels", "4"], "Did you mean --samples?"),
        (["--frames", "soon"], "not a frame range"),
        (["--frames", "1:5"], "placeholder"),
        (["-d", "-f", "1"], "not allowed with"),
        (["-w", "0"], "width"),
        (["--shading-rate", "0"], "Shading rate cannot be 0: it must be from 0.01 to 1000."),
        (["--disableGpu", "--backend", "gpu"], "contradict"),
        (["--camera", "a b"], "--camera"),
        (["--mask", "nonsense"], "--mask"),
    ],
)
def test_wrong_flags_are_usage_errors(scene, tmp_path, capsys, flags, words):
    assert run("record", scene, tmp_path / "a.exr", *flags) == 2
    text = capsys.readouterr().err
    assert words in text
    assert "Traceback" not in text
    assert not (tmp_path / "a.exr").exists()


def test_usage_errors_point_to_the_help(scene, tmp_path, capsys):
    for flags in (["--samples", "0"], ["--samples", "many"], ["--sampels", "4"], ["-f", "soon"]):
        assert run("record", scene, tmp_path / "a.exr", *flags) == 2
        assert capsys.readouterr().err.endswith("\nSee `hdtrapeze record --help`.\n")


def test_a_value_that_begins_with_a_minus(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "a.##.png", *SMALL, "--frames", "-2:0") == 2
    assert "--frames=-2:0" in capsys.readouterr().err
    assert run("record", scene, tmp_path / "a.##.png", *SMALL, "--frames=-2:0") == 0
    assert len(list(tmp_path.glob("a.*"))) == 3


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.jpg", "ends in .exr or .png, not .jpg"),
        ("a", "ends in .exr or .png"),
        (".exr", "must be a name that ends in"),
        ("a.##.exr", "--frames"),
    ],
)
def test_wrong_outputs_are_usage_errors(scene, tmp_path, capsys, name, words):
    assert run("record", scene, tmp_path / name) == 2
    assert words in capsys.readouterr().err


def test_empty_names(scene, tmp_path, capsys):
    assert run("record", scene, "") == 2
    assert "The output has no name" in capsys.readouterr().err
    assert run("record", "", tmp_path / "a.exr") == 3
    assert "The file to read has no name" in capsys.readouterr().err


def test_the_size_that_is_printed(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "a.exr", *SMALL, "--overscan", 3) == 0
    assert "40 x 40 (data window 46 x 46 at -3, -3), 4 samples" in capsys.readouterr().out


def test_png_holds_no_aovs(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "a.png", "--aov", "depth") == 2
    assert "only color" in capsys.readouterr().err


def test_unknown_aov_is_a_usage_error(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "a.exr", "--aov", "dpeth") == 2
    text = capsys.readouterr().err
    assert "dpeth" in text
    assert "Did you mean depth?" in text


def test_files_that_are_not_there_or_broken(scene, tmp_path, capsys):
    out = tmp_path / "a.exr"
    assert run("record", tmp_path / "none.usda", out) == 3
    assert "none.usda does not exist" in capsys.readouterr().err
    broken = tmp_path / "broken.usda"
    broken.write_text('#usda 1.0\ndef Mesh "x" {{{')
    assert run("record", broken, out) == 3
    text = capsys.readouterr().err
    assert "broken.usda cannot be read" in text
    assert "; ." not in text
    garbage = tmp_path / "garbage.usdc"
    garbage.write_bytes(os.urandom(100))
    assert run("record", garbage, out) == 3
    assert "garbage.usdc" in capsys.readouterr().err
    other = tmp_path / "other.txt"
    other.write_text("hello")
    assert run("record", other, out) == 3
    assert "other.txt cannot be read" in capsys.readouterr().err
    assert run("record", scene, out, "--sessionLayer", tmp_path / "no.usda") == 3
    assert run("record", scene, tmp_path / "no" / "a.exr") == 3
    assert "does not exist" in capsys.readouterr().err
    assert not out.exists()


def test_cameras_that_are_not_there(scene, tmp_path, capsys):
    assert run("record", scene, tmp_path / "a.exr", "--camera", "/nobody") == 1
    assert "/nobody" in capsys.readouterr().err
    assert run("record", scene, tmp_path / "a.exr", "-cam", "/quad") == 1
    assert "it is a Mesh" in capsys.readouterr().err


def test_empty_stage(tmp_path, capsys):
    path = tmp_path / "empty.usda"
    path.write_text("#usda 1.0\n")
    assert run("record", path, tmp_path / "a.png", *SMALL) == 0
    assert "warning: the stage has nothing to render" in capsys.readouterr().err
    assert not read_png(tmp_path / "a.png").any()


def test_warnings_and_abort_on_error(tmp_path, capsys):
    stage = new_stage()
    add_camera(stage, "/main_cam")
    add_quad(stage).GetFaceVertexIndicesAttr().Set([0, 1, 2, 9])
    UsdGeom.TetMesh.Define(stage, "/ball")
    path = tmp_path / "bad.usda"
    stage.GetRootLayer().Export(str(path))
    out = tmp_path / "a.##.png"
    assert run("record", path, out, *SMALL, "-f", "1:3") == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2, lines  # once, not once a frame
    assert any(line.startswith("warning: /quad: ") for line in lines)
    assert "warning: /ball: TetMesh is not supported yet" in lines
    assert run("record", path, tmp_path / "b.png", *SMALL, "--quiet") == 0
    text = capsys.readouterr()
    assert text.err == ""
    assert text.out == ""
    assert run("record", path, tmp_path / "c.png", *SMALL, "--abortOnError") == 1
    assert not (tmp_path / "c.png").exists()


def test_explain_verbose_memory_and_trace(scene, tmp_path, capsys):
    out, trace = tmp_path / "a.exr", tmp_path / "trace.json"
    flags = ["--explain", "--verbose", "--memstats", "--traceToFile", trace]
    assert run("record", scene, out, *SMALL, "--shutter", 0, 1, *flags) == 0
    text = capsys.readouterr().out
    assert "/quad" in text  # explain names who calls for motion
    assert "micropolygons" in text
    assert "Peak memory" in text
    events = json.loads(trace.read_text())["traceEvents"]
    names = {event["name"] for event in events}
    assert {"open stage", "read stage", "render", "write", "frame"} <= names
    assert all(event["ph"] == "X" and event["dur"] >= 0 for event in events)
    text_trace = tmp_path / "trace.txt"
    flags = ["--traceToFile", text_trace, "--traceFormat", "trace"]
    assert run("record", scene, out, *SMALL, *flags) == 0
    assert "open stage" in text_trace.read_text()


def test_a_failed_write_leaves_the_good_file(scene, tmp_path, capsys):
    out = tmp_path / "a.exr"
    assert run("record", scene, out, *SMALL) == 0
    before = out.read_bytes()
    if os.geteuid() == 0:
        # Root may write anywhere, so let the temporary file's name be too long instead.
        folder = tmp_path
        out = folder / ("x" * 300 + ".exr")
        assert run("record", scene, out, *SMALL) == 3
    else:
        tmp_path.chmod(0o500)
        assert run("record", scene, out, *SMALL) == 3
        tmp_path.chmod(0o700)
    assert "error: " in capsys.readouterr().err
    assert (tmp_path / "a.exr").read_bytes() == before
    assert {p.suffix for p in tmp_path.iterdir()} == {".exr", ".usda"}


def test_help_and_version(capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out.startswith("hdtrapeze 0.")
    assert run("record", "--help") == 0
    text = capsys.readouterr().out
    assert "exit codes" in text
    assert "130" in text
    assert run() == 2
    assert run("recrod") == 2


def start_endless(folder):
    """The command at work on a render that takes minutes, once it has said its camera."""
    stage = new_stage()
    add_camera(stage, "/main_cam")
    add_cube(stage)
    path = folder / "scene.usda"
    stage.GetRootLayer().Export(str(path))
    out = folder / "out.exr"
    return subprocess.Popen(
        [sys.executable, "-m", "hdtrapeze", "record", path, out, "-w200", "--samples=1000000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background hands an ignored SIGINT down.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_render_keeps_what_it_had(tmp_path, stop):
    out = tmp_path / "out.exr"
    out.write_bytes(b"a good file")
    process = start_endless(tmp_path)
    try:
        assert process.stdout.readline().startswith("Camera:")
        time.sleep(2.0)
        process.send_signal(stop)
        time.sleep(0.01)
        process.send_signal(stop)  # twice, as the impatient do
        _, messages = process.communicate(timeout=30)
    finally:
        process.kill()  # where it has not stopped by itself
    assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}[stop]
    assert "Traceback" not in messages
    assert out.read_bytes() == b"a good file"
    partial = Path(tmp_path / "out.partial.exr")
    assert str(partial) in messages
    header = exr_header(partial)
    assert header["hdtrapeze/complete"] == "false"


@pytest.mark.parametrize("seconds", [0.15, 0.3])
def test_interrupted_while_it_loads(tmp_path, seconds):
    process = start_endless(tmp_path)
    try:
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        _, messages = process.communicate(timeout=30)
    finally:
        process.kill()
    # Before the first line of the command runs, Python ends by the signal itself.
    assert process.returncode in (130, -signal.SIGINT)
    assert "pxr" not in messages
