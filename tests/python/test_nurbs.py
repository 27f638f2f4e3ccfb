"""NURBS patches against what they must equal: spheres, an evaluator of their own, moments."""

import numpy as np
import pytest
from oracle import agree, blurred, mean_over_times
from pxr import Gf, UsdGeom, Vt
from scenes import add_camera, new_stage, one_warning, pixel, render, set_samples

AOVS = ("color", "P", "normal", "elementId", "cameraDepth")
W = np.sqrt(0.5)
CIRCLE = np.array(
    [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float
)
CIRCLE_WEIGHTS = np.array([1, W, 1, W, 1, W, 1, W, 1])
CIRCLE_KNOTS = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
ARC = np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], dtype=float)
ARC_WEIGHTS = np.array([1, W, 1, W, 1])
ARC_KNOTS = [0, 0, 0, 1, 1, 2, 2, 2]
SPHERE = np.array([[x * r, y * r, z] for r, z in ARC for x, y in CIRCLE])
SPHERE_WEIGHTS = np.outer(ARC_WEIGHTS, CIRCLE_WEIGHTS).ravel()


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    return stage


def vectors(points):
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))


def add_patch(stage, points, orders, knots, weights=None, path="/patch"):
    patch = UsdGeom.NurbsPatch.Define(stage, path)
    counts = [len(k) - order for k, order in zip(knots, orders, strict=True)]
    assert counts[0] * counts[1] == len(points)
    patch.CreatePointsAttr(vectors(points))
    patch.CreateUVertexCountAttr(counts[0])
    patch.CreateVVertexCountAttr(counts[1])
    patch.CreateUOrderAttr(orders[0])
    patch.CreateVOrderAttr(orders[1])
    patch.CreateUKnotsAttr(Vt.DoubleArray([float(k) for k in knots[0]]))
    patch.CreateVKnotsAttr(Vt.DoubleArray([float(k) for k in knots[1]]))
    if weights is not None:
        patch.CreatePointWeightsAttr(Vt.DoubleArray([float(w) for w in weights]))
    return patch


def add_sphere(stage, radius=2.0, path="/patch"):
    return add_patch(
        stage, SPHERE * radius, (3, 3), (CIRCLE_KNOTS, ARC_KNOTS), SPHERE_WEIGHTS, path
    )


def add_sheet(stage, path="/patch"):
    """A wavy polynomial sheet: 5 x 4 points of orders 4 and 3."""
    grid = [(x - 2, (y - 1.5) * 1.2, np.sin(1.7 * x + y) * 0.6) for y in range(4) for x in range(5)]
    knots = ([0, 0, 0, 0, 1, 2, 2, 2, 2], [0, 1, 2, 3, 4, 5, 6])
    return add_patch(stage, np.array(grid), (4, 3), knots, path=path), np.array(grid), knots


def boor(knots, order, points, u):
    """De Boor's algorithm, straight from its definition, on (n, d) points."""
    p = order - 1
    k = max(i for i in range(p, len(points)) if knots[i] <= u)
    d = [np.array(points[j], dtype=float) for j in range(k - p, k + 1)]
    for r in range(1, order):
        for j in range(p, r - 1, -1):
            low, high = knots[j + k - p], knots[j + 1 + k - r]
            a = (u - low) / (high - low)
            d[j] = (1 - a) * d[j - 1] + a * d[j]
    return d[p]


def test_a_rational_sphere_is_the_sphere(stage):
    sphere = add_sphere(stage)
    image = render(stage, aovs=AOVS, samples=16, shading_rate=0.25)
    hit = image["elementId"] == 0
    # Chords are long only where the surface turns away.
    off = np.abs(np.linalg.norm(image["P"][hit], axis=-1) - 2.0)
    assert np.median(off) < 1e-3
    assert off.max() < 0.02
    stage.RemovePrim(sphere.GetPath())
    UsdGeom.Sphere.Define(stage, "/ball").CreateRadiusAttr(2.0)
    same = render(stage, aovs=AOVS, samples=16, shading_rate=0.25)
    assert image.warnings == same.warnings == []
    assert np.abs(image["color"] - same["color"]).max() < 0.07
    assert np.abs(image["color"] - same["color"]).mean() < 5e-4
    inside = same.alpha == 1
    np.testing.assert_allclose(image["normal"][inside], same["normal"][inside], atol=0.02)


def test_points_of_a_sheet_are_those_of_de_boor(stage):
    _, points, knots = add_sheet(stage)
    image = render(stage, aovs=AOVS, samples=1, shading_rate=0.1)
    assert image.warnings == []
    # A table of the surface, and for each position that was seen the nearest of its points.
    grid = points.reshape(4, 5, 3)
    us = np.linspace(knots[0][3], knots[0][5] - 1e-9, 161)
    vs = np.linspace(knots[1][2], knots[1][4] - 1e-9, 161)
    rows = np.array([[boor(knots[0], 4, row, u) for u in us] for row in grid])
    table = np.array([[boor(knots[1], 3, rows[:, i], v) for i in range(len(us))] for v in vs])
    seen = image["P"][image["elementId"] == 0]
    assert len(seen) > 100
    across = np.diff(table, axis=1)[:-1], np.diff(table, axis=0)[:, :-1]
    normals = np.cross(*across).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flat = table[:-1, :-1].reshape(-1, 3)
    for place, normal in zip(seen, image["normal"][image["elementId"] == 0], strict=True):
        nearest = np.argmin(np.linalg.norm(flat - place, axis=-1))
        # Off the table's facet at that point by no more than its bend.
        assert abs((place - flat[nearest]) @ normals[nearest]) < 2e-3
        assert np.linalg.norm(normal - normals[nearest]) < 0.05


def test_moving_points_and_velocities_blur_as_the_mean(stage):
    patch, points, _ = add_sheet(stage)
    patch.CreateDisplayColorAttr([Gf.Vec3f(0.8, 0.6, 0.3)])
    moved = points + np.sin(points[:, ::-1] * 2.0) * 0.8
    set_samples(patch.GetPointsAttr(), {0: vectors(points), 1: vectors(moved)})
    same, figures = agree(blurred(stage, shutter=(0, 1)), mean_over_times(stage))
    assert same, figures
    samples = render(stage, shutter=(0, 1), samples=64)["color"]
    patch.GetPointsAttr().ClearAtTime(1)
    set_samples(patch.CreateVelocitiesAttr(), {0: vectors((moved - points) * 24.0)})
    velocities = render(stage, shutter=(0, 1), samples=64)["color"]
    np.testing.assert_allclose(velocities, samples, atol=1e-3)


def test_colors_at_points_and_at_segments(stage):
    patch, points, _ = add_sheet(stage)
    # The surface's own x over the points makes a colour that is its x.
    values = np.stack([points[:, 0] / 4 + 0.5, points[:, 1] / 4 + 0.5, 0 * points[:, 0]], axis=1)
    primvar = patch.CreateDisplayColorPrimvar("vertex")
    primvar.Set(vectors(values))
    image = render(stage, aovs=AOVS, samples=1, camera_light=False)
    assert image.warnings == []
    shaded = render(stage, aovs=AOVS, samples=1)
    hit = shaded["elementId"] == 0
    ratio = shaded["color"][hit][:, :2]
    x, y = shaded["P"][hit][:, 0] / 4 + 0.5, shaded["P"][hit][:, 1] / 4 + 0.5
    np.testing.assert_allclose(ratio[:, 0] * y, ratio[:, 1] * x, atol=2e-3)
    # Varying: 3 x 3 ends of segments, only the middle one red.
    primvar.SetInterpolation("varying")
    colors = np.zeros((9, 3))
    colors[4] = [1, 0, 0]
    primvar.Set(vectors(colors))
    image = render(stage, aovs=AOVS, samples=1)
    assert image.warnings == []
    red = np.where(hit, image["color"][..., 0], 0)
    row = red.max(axis=1).argmax()
    middle = boor([0, 1, 2, 3, 4, 5, 6], 3, points.reshape(4, 5, 3).mean(axis=1), 3.0)
    assert abs(row - pixel(0, middle[1])[0]) <= 3
    assert red.max() > 0.2
    # Any other number is ignored.
    primvar.Set(vectors(colors[:8]))
    one_warning(render(stage), "/patch", "displayColor has 8 values", "9 ends of segments")


def test_ranges_cut_and_trims_are_named(stage):
    sphere = add_sphere(stage)
    sphere.CreateURangeAttr(Gf.Vec2d(0, 2))  # the half with y above 0
    image = render(stage)
    assert image.warnings == []
    assert (image.alpha[pixel(0, 1)], image.alpha[pixel(0, -1)]) == (1, 0)
    sphere.CreateVRangeAttr(Gf.Vec2d(-1, 1))  # the half with z below 0
    image = render(stage, aovs=AOVS)
    one_warning(image, "/patch", "vRange reaches beyond its knots")
    assert image["P"][image["elementId"] == 0][:, 2].max() < 1e-5
    stage.RemovePrim("/patch")
    add_sphere(stage).CreateTrimCurveCountsAttr([1])
    image = render(stage)
    one_warning(image, "/patch", "trim curves", "untrimmed")
    assert image.alpha[pixel(0, 1)] == 1


@pytest.mark.parametrize(
    ("name", "value", "words", "shown"),
    [
        ("uOrder", 1, "along u, order 1 is not 2 to", False),
        ("vOrder", 6, "along v, order 6 needs as many points, there are 5", False),
        ("uVertexCount", 8, "8 points of order 3 need 11 knots, there are 12", False),
        ("vKnots", [0.0, 0, 0, 2, 1, 2, 2, 2], "along v, knots", False),
        ("uKnots", [1.0] * 12, "leave nothing between them", False),
        ("points", [(0, 0, 0)] * 44, "9 x 5 points are needed, there are 44", False),
        ("points", [(0, 0, float("nan"))] * 45, "45 of 45 points are not finite", False),
        ("pointWeights", [1.0] * 44, "44 pointWeights for 45 points", True),
        ("pointWeights", [-1.0] * 45, "45 of 45 pointWeights are not above 0", True),
    ],
)
def test_what_does_not_fit_is_named(stage, name, value, words, shown):
    attribute = add_sphere(stage).GetPrim().GetAttribute(name)
    if name == "points":
        value = Vt.Vec3fArray([Gf.Vec3f(*v) for v in value])
    elif isinstance(value, list):
        value = Vt.DoubleArray(value)
    attribute.Set(value)
    image = render(stage, aovs=AOVS)
    one_warning(image, "/patch", words)
    assert image.alpha[pixel(0.1, 0.1)] == shown


def test_a_patch_without_anything_is_silent(stage):
    UsdGeom.NurbsPatch.Define(stage, "/patch")
    assert render(stage).warnings == []


def test_instances_of_a_patch(stage):
    instancer = UsdGeom.PointInstancer.Define(stage, "/points")
    sphere = add_sphere(stage, 1.0, "/points/patch")
    instancer.CreatePrototypesRel().SetTargets([sphere.GetPath()])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([Gf.Vec3f(-2, 0, 0), Gf.Vec3f(2, 1, 0)])
    image = render(stage, aovs=AOVS)
    assert image.warnings == []
    for x, y in ((-2, 0), (2, 1)):
        assert image.alpha[pixel(x, y)] == 1
    assert image.alpha[pixel(0, 0)] == 0
