"""NURBS curves against basis curves that are the same, and against circles."""

import numpy as np
import pytest
from oracle import agree, blurred, mean_over_times
from pxr import Gf, UsdGeom, Vt
from scenes import VIEW, add_camera, new_stage, one_warning, pixel, render, set_samples

AOVS = ("color", "P", "elementId")
W = float(np.sqrt(0.5))


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    return stage


def vectors(points):
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))


def add_curves(stage, points, counts, orders, knots, width=0.4, path="/curves"):
    curves = UsdGeom.NurbsCurves.Define(stage, path)
    curves.CreatePointsAttr(vectors(points))
    curves.CreateCurveVertexCountsAttr(counts)
    curves.CreateOrderAttr(orders)
    curves.CreateKnotsAttr(Vt.DoubleArray([float(k) for k in knots]))
    curves.CreateWidthsAttr([width])
    curves.SetWidthsInterpolation("constant")
    return curves


def add_arcs(stage):
    """Two curves: an arc of order 3, a straight line of order 2."""
    points = [(-3, -2, 0), (0, 4, 0), (3, -2, 0), (-3, -3, 0), (3, -3, 0)]
    knots = [0, 0, 0, 1, 1, 1, 0, 0, 1, 1]
    return add_curves(stage, points, [3, 2], [3, 2], knots, width=0.8)


def test_a_cubic_is_the_bspline_that_it_is(stage):
    points = np.array([(x - 3.5, 2 * np.sin(2.1 * x), np.cos(x)) for x in range(8)])
    add_curves(stage, points, [8], [4], list(range(12)))
    nurbs = render(stage, aovs=AOVS, samples=16, shading_rate=0.5)
    assert nurbs.warnings == []
    stage.RemovePrim("/curves")
    curves = UsdGeom.BasisCurves.Define(stage, "/curves")
    curves.CreatePointsAttr(vectors(points))
    curves.CreateCurveVertexCountsAttr([8])
    curves.CreateBasisAttr("bspline")
    curves.CreateWidthsAttr([0.4])
    curves.SetWidthsInterpolation("constant")
    bspline = render(stage, aovs=AOVS, samples=16, shading_rate=0.5)
    assert nurbs.alpha.sum() > 50
    assert np.abs(nurbs["color"] - bspline["color"]).max() < 0.15
    assert np.abs(nurbs["color"] - bspline["color"]).mean() < 1e-3


def test_a_rational_circle_is_round_and_has_its_width(stage):
    points = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(3 * x, 3 * y, 0) for x, y in points]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.CreateProjectionAttr("orthographic")
    camera.CreateHorizontalApertureAttr(VIEW * 10)
    camera.CreateVerticalApertureAttr(VIEW * 10)
    circle = add_curves(stage, points, [9], [3], knots, width=0.5)
    circle.CreatePointWeightsAttr([1, W, 1, W, 1, W, 1, W, 1])
    image = render(stage, aovs=AOVS, samples=64, shading_rate=0.5)
    assert image.warnings == []
    seen = image["P"][image["elementId"] == 0]
    radius = np.linalg.norm(seen[:, :2], axis=-1)
    assert radius.min() > 2.74
    assert radius.max() < 3.26
    # The ring's area in pixels of a quarter.
    exact = np.pi * (3.25**2 - 2.75**2) * 16
    assert abs(image.alpha.sum() / exact - 1) < 0.01


def test_ids_ranges_and_primvars(stage):
    curves = add_arcs(stage)
    curves.CreateDisplayColorPrimvar("uniform").Set([Gf.Vec3f(1, 0, 0), Gf.Vec3f(0, 1, 0)])
    image = render(stage, aovs=AOVS)
    assert image.warnings == []
    top, line = pixel(0, 1), pixel(0, -3)
    assert (image["elementId"][top], image["elementId"][line]) == (0, 1)
    assert image["color"][top][0] > 0 == image["color"][top][1]
    assert image["color"][line][1] > 0 == image["color"][line][0]
    curves.CreateRangesAttr([Gf.Vec2d(0, 0.5), Gf.Vec2d(0, 1)])
    image = render(stage)
    assert (image.alpha[pixel(-2.4, -0.92)], image.alpha[pixel(2.4, -0.92)]) == (1, 0)
    # Widths at the points: to nothing at the right end of both.
    curves.GetRangesAttr().Clear()
    curves.GetWidthsAttr().Set([1.0, 0.5, 0.0, 1.0, 0.0])
    curves.SetWidthsInterpolation("vertex")
    wide = render(stage, samples=64).alpha[24:].sum(axis=0)  # the line alone
    np.testing.assert_allclose(wide[[14, 20, 26]], [3.0, 2.0, 1.0], atol=0.25)


def test_moving_points_blur_as_the_mean(stage):
    curves = add_arcs(stage)
    points = np.array(curves.GetPointsAttr().Get())
    moved = points + np.array([[0, 1, 0], [1, -2, 0], [0, 1, 0], [0, 0, 1], [0, 1.5, 0]])
    set_samples(curves.GetPointsAttr(), {0: vectors(points), 1: vectors(moved)})
    settings = {"shading_rate": 0.5}
    same, figures = agree(
        blurred(stage, shutter=(0, 1), **settings), mean_over_times(stage, **settings)
    )
    assert same, figures
    by_samples = render(stage, shutter=(0, 1), samples=64)["color"]
    curves.GetPointsAttr().ClearAtTime(1)
    set_samples(curves.CreateVelocitiesAttr(), {0: vectors((moved - points) * 24.0)})
    by_rates = render(stage, shutter=(0, 1), samples=64)["color"]
    np.testing.assert_allclose(by_rates, by_samples, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("order", [3, 1], "1 of 2 curves cannot be used (of curve 1, order 1"),
        ("order", [3], "1 of 2 curves cannot be used (of curve 1, order 0"),
        ("knots", [0.0, 0, 0, 1, 1, 1, 0, 2, 1, 1], "of curve 1, knots are not finite numbers"),
        ("knots", [0.0, 0, 0, 1, 1, 1], "of curve 1, 2 points of order 2 need 4 knots"),
        ("points", 4, "of curve 1, points are missing"),
        ("points", 6, "the last 1 are ignored"),
        ("pointWeights", [1.0] * 4, "4 pointWeights for 5 points"),
        ("ranges", [(0.0, 1.0), (0.0, 2.0)], "ranges of 1 of 2 curves reach beyond"),
    ],
)
def test_what_does_not_fit_is_named_and_the_other_curve_renders(stage, name, value, words):
    curves = add_arcs(stage)
    if name == "points":
        points = list(curves.GetPointsAttr().Get())
        value = Vt.Vec3fArray([*points, points[-1]][:value])
    elif name == "ranges":
        value = Vt.Vec2dArray([Gf.Vec2d(*pair) for pair in value])
    curves.GetPrim().GetAttribute(name).Set(value)
    image = render(stage)
    one_warning(image, "/curves", words)
    assert image.alpha[pixel(0, 1)] == 1
