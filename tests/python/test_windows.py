"""Overscan and data windows: what is rendered around the image, and what files say of it."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer, SceneError, UsageError
from hdtrapeze.cli import main
from images import exr_header, read_exr, read_png
from pxr import Gf, UsdGeom
from scenes import add_camera, add_cube, add_quad, new_stage, quad_coverage, render, set_samples

AOVS = ("color", "depth", "P", "primId", "motionVectors", "sampleCount")


def busy_stage():
    """A subdivided, moving cube across the image's rim, and a quad far wider than the image."""
    stage = new_stage()
    add_camera(stage, fStop=2.0, focusDistance=9.0, shutter__open=0.0, shutter__close=1.0)
    cube = add_cube(stage, half=1.5, color=(1, 0.6, 0.2))
    set_samples(cube.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(-5, 2, 1), 1: Gf.Vec3d(-4, 3, 1)})
    add_quad(stage, "/back", -40, -40, 40, 40, z=-3, color=(0.1, 0.3, 0.8))
    return stage


def windowed(stage, **settings):
    """AOVs with their origin."""
    options = Options(width=40, height=40, samples=8, aovs=list(AOVS), camera="/camera", **settings)
    with Renderer(options) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        assert renderer.log.warnings == []
        origins = {renderer.aov_origin(name) for name in AOVS}
        assert len(origins) == 1
        return {name: renderer.aov(name) for name in AOVS}, origins.pop()


def test_overscan_leaves_the_bits_of_the_image():
    stage = busy_stage()
    plain, origin = windowed(stage)
    assert origin == (0, 0)
    wide, origin = windowed(stage, overscan=2)
    assert origin == (-2, -2)
    for name in AOVS:
        assert wide[name].shape[:2] == (44, 44)
        np.testing.assert_array_equal(wide[name][2:42, 2:42], plain[name], err_msg=name)
    assert (wide["sampleCount"] == 8).all()
    assert (wide["color"][..., 3] > 0.99).all(), "the quad is seen all around"


def test_overscan_beyond_the_margin_of_dicing():
    """Farther out dicing is finer than without, where faces reach there; nothing else changes."""
    stage = busy_stage()
    plain, _ = windowed(stage)
    wide, origin = windowed(stage, overscan=(overscan := 30))
    assert origin == (-30, -30)
    inside = slice(overscan, overscan + 40)
    part = wide["color"][inside, inside]
    np.testing.assert_allclose(part, plain["color"], atol=0.02)
    assert np.mean(part != plain["color"]) < 0.1
    # The whole is the image of a camera with a wider film back.
    film = stage.GetPrimAtPath("/camera")
    for name in ("horizontalAperture", "verticalAperture"):
        film.GetAttribute(name).Set(50.0)
    wider = render(stage, width=100, height=100, samples=64, filter="gaussian")["color"]
    assert np.sqrt(np.mean((wider - wide["color"]) ** 2)) < 0.05


def test_overscan_as_a_fraction():
    stage = new_stage()
    add_camera(stage, verticalAperture=10.0)
    add_quad(stage)
    options = Options(width=40, height=20, samples=1, overscan=0.25, camera="/camera")
    with Renderer(options) as renderer:
        renderer.load(stage)
        renderer.render()
        assert renderer.aov("color").shape == (30, 60, 4)
        assert renderer.aov_origin("color") == (-10, -5)


@pytest.mark.parametrize(
    ("window", "pixels"),
    [
        ((0.0, 0.0, 1.0, 1.0), (0, 0, 0, 0)),  # the image
        ((-0.1, -0.2, 1.05, 1.3), (-4, -12, 42, 48)),
        ((0.25, 0.5, 0.75, 1.0), (10, 0, 30, 20)),
        # A pixel is inside where its centre is.
        ((0.26, 0.0, 0.51, 1.0), (10, 0, 20, 40)),
        ((0.2624, 0.0, 0.5126, 1.0), (10, 0, 21, 40)),
        ((1.5, 0.0, 2.0, 0.5), (60, 20, 80, 40)),
    ],
)
def test_data_windows_in_ndc(window, pixels):
    assert Options(data_window_ndc=window).data_window(40, 40) == pixels
    # A flag takes its place.
    assert Options(data_window_ndc=window, overscan=1).data_window(40, 40) == (-1, -1, 41, 41)
    assert Options(data_window_ndc=window, crop=(1, 2, 3, 4)).data_window(40, 40) == (1, 2, 3, 4)


def test_a_data_window_beside_the_image():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, "/right", 5, -2, 9, 2)
    image, origin = windowed(stage, data_window_ndc=(1.0, 0.25, 1.5, 0.75), filter="box")
    assert origin == (0, 0)
    alpha = image["color"][..., 3]
    assert alpha.shape == (40, 60)
    assert not alpha[:, :40].any()
    # 16 of the 20 columns to the right of the image.
    expected = np.zeros((40, 60))
    expected[12:28, 40:56] = 1
    np.testing.assert_array_equal(alpha, expected)
    assert (image["sampleCount"][10:30, 40:] == 8).all()
    assert image["sampleCount"].sum() == 8 * 20 * 20


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"overscan": -1}, "from 0"),
        ({"overscan": 2.5}, "to 2"),
        ({"overscan": float("nan")}, "overscan"),
        ({"overscan": 1, "crop": (0, 0, 5, 5)}, "contradict"),
        ({"crop": (-50, -50, 300, 300)}, "begins outside of the image, at -50, -50"),
        ({"crop": (5, 0, 5, 5)}, "x0 < x1"),
        ({"shutter": (float("nan"), 1.0)}, "absurdly long"),
        ({"data_window_ndc": (0.5, 0, 0.5, 1)}, "xmin < xmax"),
        ({"data_window_ndc": (0, float("nan"), 1, 1)}, "ymin < ymax"),
        ({"data_window_ndc": (-1e9, 0, 1, 1)}, "absurdly"),
    ],
)
def test_windows_that_cannot_be(settings, words):
    with pytest.raises(UsageError, match=words):
        Options(**settings).validate()


def test_windows_without_pixels_or_of_too_many():
    with pytest.raises(SceneError, match="holds no pixel"):
        Options(data_window_ndc=(0.501, 0, 0.502, 1)).data_window(40, 40)
    with pytest.raises(UsageError, match="65536"):
        Options(overscan=30000).data_window(40, 6000)
    with pytest.raises(SceneError, match="65536"):
        Options(data_window_ndc=(0, 0, 100, 1)).data_window(2048, 1080)


@pytest.fixture
def scene(tmp_path):
    stage = new_stage()
    add_camera(stage, "/main_cam")
    add_quad(stage, x0=-8, y0=-2, x1=2, y1=2)
    path = tmp_path / "scene.usda"
    stage.GetRootLayer().Export(str(path))
    return str(path)


def record(scene, out, *flags):
    flags = ["-w", "40", "--samples", "4", "--filter", "box", "--quiet", *map(str, flags)]
    return main(["record", scene, str(out), *flags])


def test_files_of_an_overscan(scene, tmp_path):
    wide, plain = tmp_path / "wide.exr", tmp_path / "plain.exr"
    assert record(scene, wide, "--overscan", 10, "--aov", "primId") == 0
    assert record(scene, plain, "--aov", "primId") == 0
    header = exr_header(wide)
    assert header["dataWindow"] == (-10, -10, 49, 49)
    assert header["displayWindow"] == (0, 0, 39, 39)
    pixels, inside = read_exr(wide), read_exr(plain)
    for name, channel in inside.items():
        assert pixels[name].shape == (60, 60)
        np.testing.assert_array_equal(pixels[name][10:50, 10:50], channel, err_msg=name)
    # From x = -8, beyond the image's rim at -5: columns -10 to 27 hold -7.5 to 2.
    np.testing.assert_array_equal(pixels["A"][30], (np.arange(60) < 38).astype(np.float32))
    for flag in (10, "0.25"):
        png = tmp_path / "wide.png"
        assert record(scene, png, "--overscan", flag) == 0
        alpha = read_png(png)[..., 3] / 255.0
        np.testing.assert_array_equal(alpha, quad_coverage(-8, -2, 2, 2))


def test_a_crop_stays_a_crop(scene, tmp_path):
    out = tmp_path / "crop.exr"
    assert record(scene, out, "--crop", 5, 0, 15, 20) == 0
    header = exr_header(out)
    assert header["dataWindow"] == (5, 0, 14, 19)
    assert header["displayWindow"] == (0, 0, 39, 39)
    assert read_exr(out)["A"].shape == (20, 10)


def test_crop_and_overscan_contradict_each_other(scene, tmp_path, capsys):
    assert record(scene, tmp_path / "a.exr", "--crop", 5, 0, 15, 20, "--overscan", 4) == 2
    assert "contradict" in capsys.readouterr().err


def test_only_a_window_that_shows_more_dices_again():
    stage = busy_stage()
    options = Options(width=40, height=40, samples=1, camera="/camera")
    with Renderer(options) as renderer:
        diced = []
        for window in (None, (0.25, 0.25, 0.5, 0.5), (-0.5, 0.0, 1.0, 1.0)):
            options.data_window_ndc = window
            renderer.load(stage, 0.0)
            renderer.commit()
            diced.append(renderer.statistics()["objects_diced"])
    assert diced == [2, 0, 2]


def test_framing_takes_overscan_too():
    stage = new_stage()
    add_quad(stage)
    assert not stage.GetPrimAtPath("/camera")
    with Renderer(width=20, samples=1, overscan=3) as renderer:
        renderer.load(stage)
        renderer.render()
        assert renderer.aov_origin("color") == (-3, -3)
    assert UsdGeom.Camera.Get(stage, "/camera").GetPrim().IsValid() is False
