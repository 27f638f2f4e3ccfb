"""Curves that cannot be: one warning that names the prim, and the rest renders."""

import numpy as np
import pytest
from pxr import Sdf, UsdGeom, Vt
from scenes import add_camera, add_quad, new_stage, one_warning, pixel, quad_coverage, render
from strands import add_curves, normals, vectors

NAN, INF = float("nan"), float("inf")
GOOD = (3.0, 3.0, 4.5, 4.5)
FOUR = [(-3, 0, 0), (-1, 0, 0), (1, 0, 0), (3, 0, 0)]


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, "/good", *GOOD)
    return stage


def check(stage, *words, shown=None, **settings):
    for form in ("ribbons", "tubes"):
        image = render(stage, aovs=("color", "P", "elementId"), curves=form, **settings)
        if words:
            one_warning(image, "/bad", *words)
        else:
            assert image.warnings == []
        good = quad_coverage(*GOOD) == 1
        assert (image.alpha[good] == 1).all()
        for values in image.values():
            assert np.isfinite(values).all()
        if shown is not None:
            assert image.alpha[pixel(0.1, 0.1)] == shown
    return image


@pytest.mark.parametrize(
    ("basis", "wrap", "counts", "words", "shown"),
    [
        ("linear", "nonperiodic", [1], "fewer than the 2 points", 0),
        ("linear", "periodic", [2], "fewer than the 3 points", 0),
        ("linear", "nonperiodic", [4, 1], "1 of 2 curves", 1),
        ("linear", "nonperiodic", [-4, 4], "1 of 2 curves", 1),
        ("bezier", "nonperiodic", [3], "fewer than the 4 points", 0),
        ("bspline", "nonperiodic", [3], "fewer than the 4 points", 0),
        ("catmullRom", "pinned", [1], "fewer than the 2 points", 0),
        ("bspline", "periodic", [2], "fewer than the 3 points", 0),
        ("bezier", "periodic", [4], "points behind their last whole", None),
        ("bezier", "nonperiodic", [5], "points behind their last whole", 1),
        ("linear", "nonperiodic", [4, 4], "sum to 8 but there are 4 points", 1),
        ("linear", "nonperiodic", [2147483647, 2147483647], "2 of 2 curves are dropped", 0),
    ],
)
def test_counts_that_cannot_be(stage, basis, wrap, counts, words, shown):
    # As many points as the counts ask for, up to 8.
    total = sum(max(c, 0) for c in counts)
    points = FOUR if total >= 8 else [*FOUR, (4, 1, 0), (4, 2, 0)][:total]
    add_curves(stage, "/bad", points, counts, basis, wrap, widths=1.0)
    check(stage, words, shown=shown)


def test_points_that_are_over_or_missing(stage):
    bad = add_curves(stage, "/bad", [*FOUR, (4, 4, 4)], [4], widths=1.0)
    check(stage, "the last 1 are ignored", shown=1)
    bad.GetPointsAttr().Set(vectors([]))
    check(stage, "1 curves but no points", shown=0)
    bad.GetPointsAttr().Clear()
    check(stage, "1 curves but no points", shown=0)


def test_nothing_is_silent(stage):
    UsdGeom.BasisCurves.Define(stage, "/unset")
    add_curves(stage, "/empty", [], [])
    add_curves(stage, "/gap", [*FOUR, *FOUR], [4, 0, 4])
    check(stage)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ((NAN, 0, 0), "not finite"),
        ((0, INF, 0), "not finite"),
        ((0, 0, 1e30), "beyond the largest"),
    ],
)
def test_points_that_cannot_be_take_their_curve_only(stage, bad, words):
    points = [*FOUR, (0, -3, 0), bad]
    add_curves(stage, "/bad", points, [4, 2], widths=1.0)
    check(stage, "1 of 2 curves", words, shown=1)


@pytest.mark.parametrize("basis", ["linear", "bezier", "bspline", "catmullRom"])
@pytest.mark.parametrize("wrap", ["nonperiodic", "periodic", "pinned"])
def test_points_that_coincide(stage, basis, wrap):
    count = 6 if wrap == "periodic" else 7
    add_curves(stage, "/point", [(0, -3, 0)] * count, None, basis, wrap, widths=1.0)
    doubled = [(-3, 0, 0), (-3, 0, 0), (-3, 0, 0), (0, 0, 0), (0, 0, 0), (3, 0, 0), (3, 0, 0)]
    add_curves(stage, "/doubled", doubled[:count], None, basis, wrap, widths=1.0)
    back = [(-3, 0, 0), (3, 0, 0), (-3, 0, 0), (3, 0, 0), (-3, 0, 0), (3, 0, 0), (-3, 0, 0)]
    add_curves(stage, "/back", back[:count], None, basis, wrap, widths=1.0)
    # Straight at the camera, and past it.
    add_curves(stage, "/axis", [(-2, -2, z) for z in np.linspace(-5, 15, count)], None, basis, wrap)
    image = check(stage, shown=1)
    assert image.alpha[pixel(0, -3.2)] == 0, "a curve of one point is nothing"


@pytest.mark.parametrize(
    ("widths", "interpolation", "words", "shown"),
    [
        ([-1], "constant", "1 of 1 widths", 0),
        ([1, NAN, 1, 1], "vertex", "1 of 4 widths", 1),
        ([INF] * 4, "vertex", "4 of 4 widths", 0),
        ([1, 2, 3], "vertex", "3 values where its prim has 4 points", 1),
        ([1, 2, 3], "uniform", "3 values where its prim has 1 elements", 1),
        ([1, 2, 3], "varying", "3 values where its prim has 2 varying", 1),
    ],
)
def test_widths_that_cannot_be(stage, widths, interpolation, words, shown):
    add_curves(stage, "/bad", FOUR, [4], "bezier", widths=widths, interpolation=interpolation)
    check(stage, words, shown=shown)


def test_normals_that_cannot_be(stage):
    bad = add_curves(stage, "/bad", FOUR, [4], "bezier", widths=1.0)
    normals(bad, [(0, 0, 1)] * 3, "vertex")
    check(stage, "normals", "3 values", shown=1)
    normals(bad, [(0, 0, NAN)], "constant")
    check(stage, "normals", "not finite", shown=1)
    # Along the curve, or zero: no direction to lie across, but a ribbon all the same.
    for value in ((1, 0, 0), (0, 0, 0)):
        normals(bad, [value], "constant")
        check(stage)


def test_values_of_another_length_or_indexed_wrong(stage):
    bad = add_curves(stage, "/bad", FOUR, [4], "bezier", widths=1.0, color=None)
    primvar = bad.CreateDisplayColorPrimvar("varying")
    primvar.Set(vectors([(1, 0, 0)] * 4))
    check(stage, "displayColor", "4 values where its curves has 2", shown=1)
    primvar.SetInterpolation("vertex")
    check(stage, shown=1)
    primvar.SetIndices(Vt.IntArray([0, 1, 2, 4]))
    check(stage, "displayColor", "indices", shown=1)
    primvar.SetIndices(Vt.IntArray([0, 0, 3, 1]))
    check(stage, shown=1)
    primvar.Set(vectors([(NAN, 0, 0)] * 4))
    check(stage, "displayColor", "not finite", shown=1)


def test_samples_of_other_lengths(stage):
    bad = add_curves(stage, "/bad", FOUR, [4], widths=1.0)
    bad.GetPointsAttr().Set(vectors(FOUR), 0)
    bad.GetPointsAttr().Set(vectors(FOUR[:2]), 1)
    check(stage, "number of points changes", shown=1, shutter=(0, 1))


def test_attributes_of_another_type(stage):
    for name, kind, value in (
        ("points", Sdf.ValueTypeNames.IntArray, Vt.IntArray([1, 2, 3])),
        ("curveVertexCounts", Sdf.ValueTypeNames.StringArray, Vt.StringArray(["a"])),
    ):
        curves = add_curves(stage, f"/bad_{name}", FOUR, [4])
        curves.GetPrim().RemoveProperty(name)
        spec = stage.GetRootLayer().GetPrimAtPath(curves.GetPath())
        Sdf.AttributeSpec(spec, name, kind).default = value
    image = render(stage)
    assert {w[0] for w in image.warnings} == {"/bad_points", "/bad_curveVertexCounts"}
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def test_widths_of_another_type(stage):
    bad = add_curves(stage, "/bad", FOUR, [4], widths=None)
    spec = stage.GetRootLayer().GetPrimAtPath("/bad")
    Sdf.AttributeSpec(spec, "widths", Sdf.ValueTypeNames.String).default = "thick"
    assert bad
    check(stage, "widths", shown=1)


def test_curves_beyond_all_measure(stage):
    add_curves(stage, "/far", [(-1e9, 1, 0), (1e9, 1, 0)], widths=0.5)
    add_curves(stage, "/wide", [(-3, -30, -20), (3, -30, -20)], widths=20.0)
    add_curves(stage, "/behind", [(0, 0, 12), (0, 0.3, 50)], widths=1.0)
    image = render(stage, samples=16)
    assert image.warnings == []
    assert image.alpha[pixel(0.1, 1.0)] > 0.5
    assert image.statistics["micropolygons"] < 100_000
