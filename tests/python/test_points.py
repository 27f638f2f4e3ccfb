"""Points: spheres against closed forms, widths and values where they belong."""

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom
from scenes import SIZE, add_camera, new_stage, one_warning, pixel, render
from strands import WHITE, add_points, brightness, floats, vectors


def stage_with(*args, **kwargs):
    stage = new_stage()
    camera = add_camera(stage)
    camera.GetProjectionAttr().Set("orthographic")
    for attribute in (camera.GetHorizontalApertureAttr(), camera.GetVerticalApertureAttr()):
        attribute.Set(100.0)
    return stage, add_points(stage, "/points", *args, **kwargs)


LATTICE = [(x + 0.03 * y, y + 0.05 * x, 0.3 * x) for x in range(-4, 5) for y in range(-4, 5)]
"""Centres at 81 different places within their pixels; 1 unit apart, 4 pixels."""


@pytest.mark.parametrize("diameter", [0.05, 0.15, 0.4, 0.8])
def test_the_disks_area_and_the_spheres_brightness(diameter):
    stage, _ = stage_with(LATTICE, widths=diameter)
    image = render(stage, samples=64 if diameter > 0.1 else 256)
    assert image.warnings == []
    expected = 81 * np.pi / 4 * diameter**2 * 16
    assert image.alpha.sum() == pytest.approx(expected, rel=0.05 if diameter < 0.1 else 0.02)
    assert brightness(image) == pytest.approx(2 / 3, rel=0.03)


def test_a_large_sphere():
    stage, _ = stage_with([(0, 0, 0)], widths=8.0)
    image = render(stage, aovs=("color", "normal", "P", "elementId"), samples=64)
    for x, y in ((0.1, 0.1), (2.1, -1.4), (-3.1, 0.6), (0.6, 3.4)):
        row, column = pixel(x, y)
        at = np.array([(column + 0.5) / 4 - 5, 5 - (row + 0.5) / 4])
        normal = np.array([*at, np.sqrt(16 - (at**2).sum())]) / 4
        np.testing.assert_allclose(image["normal"][row, column], normal, atol=0.03)
        assert image["P"][row, column][2] == pytest.approx(4 * normal[2], abs=0.25)
        assert image["color"][row, column][0] == pytest.approx(WHITE * normal[2], rel=0.05)
    # The outline: every pixel by its distance from the middle.
    y, x = (np.mgrid[:SIZE, :SIZE] + 0.5) / 4 - 5
    distance = np.hypot(x, y)
    assert (image.alpha[distance < 3.75] == 1).all()
    assert (image.alpha[distance > 4.25] == 0).all()
    assert image.alpha.sum() == pytest.approx(np.pi * 16 * 16, rel=0.003)


def test_widths_in_each_interpolation():
    points = [(-3, 0, 0), (0, 0, 0), (3, 0, 0)]
    area = lambda *d: 16 * np.pi / 4 * sum(x * x for x in d)  # noqa: E731
    for widths, interpolation, expected in (
        ([1.5], "constant", area(1.5, 1.5, 1.5)),
        ([1.0, 2.0, 0.5], "vertex", area(1, 2, 0.5)),
        ([1.0, 2.0, 0.5], "varying", area(1, 2, 0.5)),
        ([0.0, 2.0, 0.0], "vertex", area(2)),
    ):
        stage, _ = stage_with(points, widths=widths, interpolation=interpolation)
        image = render(stage, samples=64)
        assert image.warnings == []
        assert image.alpha.sum() == pytest.approx(expected, rel=0.02), interpolation
    stage, points = stage_with(points, widths=None)
    assert render(stage, samples=64).alpha.sum() == pytest.approx(area(1, 1, 1), rel=0.02)
    primvar = UsdGeom.PrimvarsAPI(points).CreatePrimvar(
        "widths", Sdf.ValueTypeNames.FloatArray, "constant"
    )
    primvar.Set(floats([2]))
    assert render(stage, samples=64).alpha.sum() == pytest.approx(area(2, 2, 2), rel=0.02)


@pytest.mark.parametrize("interpolation", ["vertex", "varying"])
@pytest.mark.parametrize("width", [0.4, 2.0])
def test_each_point_has_its_color_and_element(interpolation, width):
    points = [(3.125, 0.125, 0), (-3.125, 0.125, 0), (0.125, 0.125, 0)]
    stage, spheres = stage_with(points, widths=width, color=None)
    spheres.CreateDisplayColorPrimvar(interpolation).Set(vectors(np.eye(3)))
    spheres.CreateIdsAttr([70, 80, 90])
    image = render(stage, aovs=("color", "elementId"), samples=16)
    assert image.warnings == []
    for i, (x, *_) in enumerate(points):
        at = pixel(x, 0.125)
        color = image["color"][at][:3]
        assert color.argmax() == i and color[i] > 0
        assert (np.delete(color, i) == 0).all()
        assert image["elementId"][at] == i


def test_points_in_a_stretched_space_are_ellipsoids():
    stage, points = stage_with([(0, 0, 0), (0.2, 1, 0)], widths=0.5)
    points.AddScaleOp().Set(Gf.Vec3f(8, 2, 5))
    image = render(stage, samples=64)
    expected = 2 * np.pi / 4 * 0.25 * 16 * 16
    assert image.alpha.sum() == pytest.approx(expected, rel=0.01)
    for x, y, inside in ((1.3, 0, 1), (2.3, 0, 0), (0, 0.2, 1), (0, 0.8, 0)):
        assert image.alpha[pixel(x, y)] == inside


def test_instanced_points_look_alike():
    rng = np.random.default_rng(7)
    places = rng.uniform(-4, 4, (40, 3)) * [1, 1, 0.3]
    widths = rng.uniform(0.2, 1.0, 40)
    stage, points = stage_with(places, widths=widths)
    flat = render(stage, samples=64)
    instancer = UsdGeom.PointInstancer.Define(stage, "/instancer")
    stage.DefinePrim("/instancer/prototype")
    add_points(stage, "/instancer/prototype/points", places, widths=widths)
    instancer.CreatePrototypesRel().SetTargets(["/instancer/prototype"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr(vectors([(0, 0, 0), (40, 0, 0)]))
    points.GetPrim().SetActive(False)
    image = render(stage, samples=64)
    assert image.warnings == []
    np.testing.assert_allclose(image.alpha, flat.alpha, atol=0.15)
    assert image.alpha.sum() == pytest.approx(flat.alpha.sum(), rel=0.01)
    assert brightness(image) == pytest.approx(brightness(flat), rel=0.02)


def test_a_defocused_particle_spreads_and_keeps_its_light():
    stage = new_stage()
    add_camera(stage, fStop=0.5, focusDistance=6.0)
    # The circle of confusion: 20 tenths / (2 * 0.5) of lens at a distance of 10, focused at 6.
    add_points(stage, "/p", [(0, 0, 0)], widths=0.2)
    image = render(stage, samples=1024)
    sharp = render(stage, samples=1024, defocus=False)
    assert image.alpha.sum() == pytest.approx(sharp.alpha.sum(), rel=0.05)
    assert image.alpha.max() < sharp.alpha.max() / 3
    radius = 2.0 * (10 - 6) / 6 * 4
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    assert (image.alpha[np.hypot(x, y) > radius + 1.5] == 0).all()
    assert (image.alpha[np.hypot(x, y) < radius - 1.5] > 0).mean() > 0.9


def test_points_of_another_number_at_the_next_frame():
    from hdtrapeze import Options, Renderer

    stage, points = stage_with([(-3, 0, 0)], widths=1.0)
    points.GetPointsAttr().Set(vectors([(-3, 0, 0)]), 0)
    points.GetPointsAttr().Set(vectors([(-3, 0, 0), (3, 0, 0)]), 1)
    with Renderer(Options(width=SIZE, height=SIZE, camera="/camera", samples=16)) as renderer:
        images = []
        for frame in (0, 1):
            renderer.load(stage, frame)
            renderer.render()
            images.append(renderer.aov("color")[..., 3])
        assert renderer.log.warnings == []
    assert images[0][pixel(-3, 0)] == 1 and images[0][pixel(3, 0)] == 0
    assert images[1][pixel(-3, 0)] == 1 and images[1][pixel(3, 0)] == 1


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0, 0, 0), (NAN, 1, 1)], "1 of 2 points"),
        ([(0, 0, 0), (INF, 1, 1), (1e30, 0, 0)], "2 of 3 points"),
        ([(NAN, 0, 0)], "1 of 1 points"),
    ],
)
def test_points_that_are_not_finite(points, words):
    stage, _ = stage_with(points, widths=1.0)
    image = render(stage)
    one_warning(image, "/points", words)
    assert image.alpha[pixel(0, 0)] == (0 if len(points) == 1 else 1)


@pytest.mark.parametrize(
    ("widths", "interpolation", "words", "area"),
    [
        ([1, -1, 1], "vertex", "1 of 3 widths", 2),
        ([1, NAN, INF], "vertex", "2 of 3 widths", 1),
        ([-1], "constant", "1 of 1 widths", 0),
        ([1, 0.2], "vertex", "its first value, 1", 3),
        ([1] * 5, "varying", "its first value, 1", 3),
    ],
)
def test_widths_that_cannot_be(widths, interpolation, words, area):
    stage, _ = stage_with(
        [(-3, 0, 0), (0, 0, 0), (3, 0, 0)], widths=widths, interpolation=interpolation
    )
    image = render(stage, samples=64)
    one_warning(image, "/points", words)
    assert image.alpha.sum() == pytest.approx(area * 4 * np.pi, rel=0.03, abs=1e-6)


def test_no_points_are_silent():
    stage, _ = stage_with([], widths=[])
    UsdGeom.Points.Define(stage, "/unset")
    add_points(stage, "/one", [(0, 0, 0)])
    assert render(stage).warnings == []


def test_colors_of_a_wrong_number():
    stage, points = stage_with([(0, 0, 0), (2, 0, 0)], widths=1.0, color=None)
    points.CreateDisplayColorPrimvar("vertex").Set(vectors([(1, 0, 0)] * 3))
    image = render(stage)
    one_warning(image, "/points", "displayColor", "3 values")
    assert image.alpha[pixel(0, 0)] == 1
