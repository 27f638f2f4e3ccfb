"""BasisCurves: shapes against closed forms, forms against each other, values where they belong."""

import itertools

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom, Vt
from scenes import SIZE, add_camera, new_stage, one_warning, pixel, quad_coverage, render
from strands import WHITE, ZIGZAG, add_curves, brightness, floats, normals, vectors

FORMS = ("ribbons", "tubes")
ALONG_X = [(-3, 0, 0), (-1, 0, 0), (1, 0, 0), (3, 0, 0)]


def stage_with(*args, **kwargs):
    stage = new_stage()
    add_camera(stage)
    curves = add_curves(stage, "/curves", *args, **kwargs)
    return stage, curves


def far_camera(stage):
    """Orthographic, so that sizes do not depend on depth; 4 pixels a unit all the same."""
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.GetProjectionAttr().Set("orthographic")
    for attribute in (camera.GetHorizontalApertureAttr(), camera.GetVerticalApertureAttr()):
        attribute.Set(100.0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("basis", ["linear", "bezier", "bspline", "catmullRom"])
def test_a_straight_curve_covers_length_times_width(form, basis):
    for width in (0.02, 0.2, 1.0):  # 0.08, 0.8 and 4 pixels
        stage, _ = stage_with(ALONG_X, basis=basis, wrap="pinned", widths=width)
        far_camera(stage)
        image = render(stage, curves=form, samples=256)
        assert image.warnings == []
        expected = 6 * width * 16
        # Tubes of few sides are as wide on the mean; one alone may be off by the tolerance.
        slack = 0.01 if form == "ribbons" else 2 * 0.1 * 24 / expected
        assert image.alpha.sum() == pytest.approx(expected, rel=slack)


@pytest.mark.parametrize("form", FORMS)
def test_a_wide_curve_has_the_outline_of_a_rectangle(form):
    stage, _ = stage_with(ALONG_X, widths=2.0)
    far_camera(stage)
    alpha = render(stage, curves=form, samples=64).alpha
    np.testing.assert_allclose(alpha, quad_coverage(-3, -1, 3, 1), atol=0.12)


def test_a_tube_is_shaded_as_a_cylinder():
    stage, _ = stage_with(ALONG_X, widths=4.0)
    far_camera(stage)
    image = render(stage, aovs=("color", "normal", "P"), curves="tubes", samples=64)
    for y in (-1.5, -0.5, 0.125, 1.0):
        at = pixel(0.125, y + 0.01)
        rows = np.arange(16) / 16 / 4
        middle = SIZE / 2 / 4 - at[0] / 4 - rows - 1 / 128
        z = np.sqrt(4 - middle**2)
        np.testing.assert_allclose(
            image["normal"][at], [0, middle.mean() / 2, z.mean() / 2], atol=0.02
        )
        assert image["color"][at][0] == pytest.approx(WHITE * z.mean() / 2, rel=0.02)
        assert image["P"][at][2] == pytest.approx(z.mean(), abs=0.06)


def test_brightness_does_not_change_with_the_form():
    # Lines at several angles that do not meet, so that pixels do not matter.
    ends = [(x + s * y / 8, y, 0) for s, x in enumerate((-4, -2, 0, 2)) for y in (-4, 4)]
    values = {}
    for width in (0.02, 0.2, 0.6):  # 0.16, 1.6 and 4.8 pixels
        for form in FORMS:
            stage, _ = stage_with(ends, counts=[2] * 4, widths=width)
            far_camera(stage)
            image = render(stage, curves=form, samples=64, width=80, height=80)
            values[width, form] = brightness(image)
    for (width, form), value in values.items():
        # A cylinder seen from the side has pi/4; few sides make it a little darker.
        few = form == "tubes" and width < 0.6
        assert value == pytest.approx(np.pi / 4, rel=0.07 if few else 0.02), values


def test_thin_curves_are_ribbons_and_wide_ones_tubes():
    counts = {}
    for name, width in (("thin", 0.5), ("wide", 1.5)):
        stage, _ = stage_with(ALONG_X, widths=width)
        counts[name] = [
            render(stage, curves=form).statistics["micropolygons"]
            for form in ("auto", "ribbons", "tubes")
        ]
    thin, wide = counts["thin"], counts["wide"]
    assert thin[0] == thin[1] < thin[2]
    assert wide[0] == wide[2] > wide[1]


def test_a_prim_may_say_its_form():
    stage, _curves = stage_with(ALONG_X, widths=1.5)
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/curves")).CreatePrimvar(
        "trapeze:curves", Sdf.ValueTypeNames.Token
    )
    tubes = render(stage, curves="tubes").statistics["micropolygons"]
    ribbons = render(stage, curves="ribbons").statistics["micropolygons"]
    primvar.Set("ribbons")
    for form in ("auto", "tubes"):
        assert render(stage, curves=form).statistics["micropolygons"] == ribbons
    primvar.Set("tubes")
    assert render(stage, curves="ribbons").statistics["micropolygons"] == tubes
    primvar.Set("spaghetti")
    image = render(stage, curves="ribbons")
    assert image.statistics["micropolygons"] == ribbons
    one_warning(image, "/curves", "spaghetti", "ignored")


def test_instanced_curves_are_tubes_that_look_alike():
    stage, curves = stage_with(ZIGZAG, basis="catmullRom", wrap="pinned", widths=0.4)
    flat = render(stage, curves="tubes", samples=64, width=80, height=80)
    instancer = UsdGeom.PointInstancer.Define(stage, "/instancer")
    stage.DefinePrim("/instancer/prototype")
    add_curves(
        stage, "/instancer/prototype/curves", ZIGZAG, basis="catmullRom", wrap="pinned", widths=0.4
    )
    instancer.CreatePrototypesRel().SetTargets(["/instancer/prototype"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr(vectors([(0, 0, 0), (0, 40, 0)]))
    curves.GetPrim().SetActive(False)
    image = render(stage, curves="ribbons", samples=64, width=80, height=80)
    assert image.warnings == []
    np.testing.assert_allclose(image["color"], flat["color"], atol=0.12)
    assert image.alpha.sum() == pytest.approx(flat.alpha.sum(), rel=0.005)


@pytest.mark.parametrize("form", FORMS)
def test_elements_are_curves(form):
    points = [(x, y, 0) for y in (3, 0, -3) for x in (-3, 3)]
    stage, _ = stage_with(points, counts=[2, 2, 2], widths=1.0)
    image = render(stage, aovs=("color", "elementId"), curves=form)
    assert [image["elementId"][pixel(0.1, y)] for y in (3, 0, -3)] == [0, 1, 2]


def albedo(image, x, y, normal=1.0):
    return image["color"][pixel(x, y)][:3] / WHITE / normal


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("interpolation", "count", "expected"),
    [
        # At the ends, the middle of the first half, and the middle: red runs from 0 to 1.
        ("varying", 3, (0, 0.25, 0.5, 1)),
        ("vertex", 7, (0, 0.25, 0.5, 1)),
    ],
)
def test_colors_run_along_curves(form, interpolation, count, expected):
    points = [(x, 0, 0) for x in np.linspace(-4, 4, 7)]
    stage, curves = stage_with(points, basis="bezier", widths=1.0, color=None)
    primvar = curves.CreateDisplayColorPrimvar(interpolation)
    primvar.Set(vectors([(r, 1, 0) for r in np.linspace(0, 1, count)]))
    far_camera(stage)
    image = render(stage, samples=64, curves=form)
    assert image.warnings == []
    for x, red in zip((-3.9, -2, 0, 3.9), expected, strict=True):
        color = image["color"][pixel(x, 0)]
        assert color[0] / color[1] == pytest.approx(red, abs=0.03)


def test_vertex_and_varying_values_of_cubic_curves_are_counted_apart():
    points = [(x, 0, 0) for x in np.linspace(-4, 4, 7)]
    for interpolation, count in (("varying", 7), ("vertex", 3), ("vertex", 5), ("varying", 4)):
        stage, curves = stage_with(points, basis="bezier", color=None)
        primvar = curves.CreateDisplayColorPrimvar(interpolation)
        primvar.Set(vectors([(1, 0, 0)] * count))
        image = render(stage)
        one_warning(image, "/curves", "displayColor", f"{count} values")
        assert image.alpha.any()
    # 7 points of a B-spline are 4 segments, pinned 6.
    for basis, wrap, count in (
        ("bspline", "nonperiodic", 5),
        ("bspline", "pinned", 7),
        ("linear", "periodic", 7),
    ):
        stage, curves = stage_with(points, basis=basis, wrap=wrap, color=None)
        curves.CreateDisplayColorPrimvar("varying").Set(vectors([(1, 0, 0)] * count))
        assert render(stage).warnings == []


def test_uniform_colors_and_opacity():
    points = [(x, y, 0) for y in (2, -2) for x in (-3, 3)]
    stage, curves = stage_with(points, counts=[2, 2], widths=1.0, color=None)
    curves.CreateDisplayColorPrimvar("uniform").Set(vectors([(1, 0, 0), (0, 1, 0)]))
    curves.CreateDisplayOpacityPrimvar("uniform").Set(floats([1, 0.5]))
    image = render(stage, curves="ribbons", samples=16)
    assert image["color"][pixel(0.1, 2)][1] == 0
    assert image["color"][pixel(0.1, -2)][0] == 0
    assert image.alpha[pixel(0.1, -2)] == pytest.approx(0.5)


def test_widths_unauthored_are_one_and_primvars_win():
    stage, curves = stage_with(ALONG_X, widths=None)
    far_camera(stage)
    assert render(stage, curves="ribbons", samples=64).alpha.sum() == pytest.approx(
        6 * 16, rel=0.01
    )
    curves.CreateWidthsAttr(floats([0.5]))
    curves.SetWidthsInterpolation("constant")
    assert render(stage, curves="ribbons", samples=64).alpha.sum() == pytest.approx(
        3 * 16, rel=0.01
    )
    primvar = UsdGeom.PrimvarsAPI(curves).CreatePrimvar(
        "widths", Sdf.ValueTypeNames.FloatArray, "varying"
    )
    primvar.Set(floats([2, 0, 0, 0]))
    alpha = render(stage, curves="ribbons", samples=64).alpha
    assert alpha.sum() == pytest.approx(2 * 16, rel=0.01), "a triangle of width 2 and length 2"


def test_flat_ribbons_lie_across_their_normals():
    for interpolation, values in (
        ("constant", [(0, 0, 1)]),
        ("uniform", [(0, 0, 1)]),
        ("varying", [(0, 0, 1)] * 2),
        ("vertex", [(0, 0, 1)] * 4),
    ):
        stage, curves = stage_with(ALONG_X, basis="bezier", widths=2.0)
        normals(curves, values, interpolation)
        image = render(stage, aovs=("color", "normal"), samples=64)
        assert image.warnings == []
        np.testing.assert_allclose(image.alpha, quad_coverage(-3, -1, 3, 1), atol=0.05)
        # Flat: as bright all over.
        assert albedo(image, 0.1, 0.9)[0] == pytest.approx(1, rel=1e-3)
    # Seen on edge there is nothing.
    normals(curves, [(0, 1, 0)] * 4, "vertex")
    far_camera(stage)
    assert render(stage, samples=64).alpha.sum() < 1
    # Half way it is half as wide, and as bright as a plane at 60 degrees.
    normals(curves, [(0, np.sqrt(3) / 2, 0.5)] * 4, "vertex")
    image = render(stage, samples=64)
    assert image.alpha.sum() == pytest.approx(6 * 16, rel=0.01)
    assert albedo(image, 0.1, 0.1)[0] == pytest.approx(0.5, rel=0.01)


def test_a_twisting_ribbon():
    stage, curves = stage_with(ALONG_X, widths=2.0)
    far_camera(stage)
    turns = np.linspace(0, np.pi, 4)
    normals(curves, [(0, np.sin(a), np.cos(a)) for a in turns], "vertex")
    alpha = render(stage, samples=256).alpha
    # The normal goes straight between points: over a segment of 60 degrees from a to b.
    expected = 0
    for a, b in itertools.pairwise(turns):
        f = (np.arange(4000) + 0.5) / 4000
        y, z = np.sin(a) * (1 - f) + np.sin(b) * f, np.cos(a) * (1 - f) + np.cos(b) * f
        expected += 2 * 16 * 2 * np.mean(np.abs(z) / np.hypot(y, z))
    # Chords between stations are up to a tenth of a pixel within the edges.
    assert alpha.sum() == pytest.approx(expected, rel=0.02)


def test_periodic_curves_close():
    ring = [(2 * np.cos(a), 2 * np.sin(a), 0) for a in np.arange(12) * np.pi / 6]
    for basis in ("linear", "bspline", "catmullRom"):
        for form in FORMS:
            stage, _ = stage_with(ring, basis=basis, wrap="periodic", widths=0.5)
            image = render(stage, curves=form, samples=64)
            radius = {"linear": 1.95, "bspline": 1.91, "catmullRom": 2.0}[basis]
            for a in np.radians([1, 44, 91, 179, 266, 331, 359]):
                at = pixel(radius * np.cos(a), radius * np.sin(a))
                assert image.alpha[at] > 0.3, (basis, form, a)
            assert image.alpha[pixel(0, 0)] == 0


def test_basis_and_wrap_that_do_not_exist():
    for name, words in (("basis", "bezier"), ("wrap", "nonperiodic"), ("type", "cubic")):
        stage, curves = stage_with(ALONG_X, basis="bezier")
        curves.GetPrim().GetAttribute(name).Set("hermitian")
        image = render(stage)
        one_warning(image, "/curves", "hermitian", words)
        assert image.alpha.any()


def test_hair_is_the_same_for_any_number_of_threads():
    rng = np.random.default_rng(5)
    roots = rng.uniform(-4, 4, (300, 1, 3)) * [1, 1, 0.2]
    points = roots + np.linspace(0, 1, 6)[:, None] * rng.normal(size=(300, 1, 3))
    stage, _ = stage_with(points.reshape(-1, 3), counts=[6] * 300, basis="bspline", widths=0.05)
    one, two = (render(stage, threads=n)["color"] for n in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_curves_of_another_frame_are_read_anew():
    from hdtrapeze import Options, Renderer

    stage, curves = stage_with(ALONG_X, widths=1.0)
    curves.GetPointsAttr().Set(vectors(ALONG_X), 0)
    curves.GetPointsAttr().Set(vectors(np.add(ALONG_X, (0, 3, 0))), 1)
    curves.GetCurveVertexCountsAttr().Set([4], 0)
    curves.GetCurveVertexCountsAttr().Set([2, 2], 1)
    with Renderer(Options(width=SIZE, height=SIZE, camera="/camera", samples=4)) as renderer:
        images = []
        for frame in (0, 1):
            renderer.load(stage, frame)
            renderer.render()
            images.append(renderer.aov("color")[..., 3])
    assert images[0][pixel(0.1, 0.1)] == 1
    assert images[1][pixel(0.1, 0.1)] == 0 and images[1][pixel(2.1, 3)] == 1
    assert images[1][pixel(0.1, 3)] == 0, "two curves with a gap between"


def test_vertex_counts_of_usd_are_ours():
    # Every basis and wrap, against USD's own counting where it is right about it.
    for basis, wrap, count in (
        ("bezier", "nonperiodic", 10),
        ("bezier", "periodic", 9),
        ("bspline", "nonperiodic", 8),
        ("bspline", "periodic", 8),
        ("catmullRom", "nonperiodic", 8),
        ("linear", "nonperiodic", 8),
    ):
        points = [(x, (-1) ** i, 0) for i, x in enumerate(np.linspace(-4, 4, count))]
        stage, curves = stage_with(points, basis=basis, wrap=wrap, color=None)
        values = curves.ComputeVaryingDataSize(0)
        curves.CreateDisplayColorPrimvar("varying").Set(vectors([(1, 0, 0)] * values))
        assert render(stage).warnings == [], (basis, wrap)
        color = Vt.Vec3fArray([Gf.Vec3f(1)] * curves.ComputeVertexDataSize(0))
        curves.CreateDisplayColorPrimvar("vertex").Set(color)
        assert render(stage).warnings == [], (basis, wrap)
