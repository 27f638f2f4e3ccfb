"""Limit surfaces against closed forms, and the options of subdivision."""

import numpy as np
import pytest
from pxr import Gf
from scenes import add_camera, add_cube, add_grid, add_mesh, new_stage, pixel, quad_coverage, render

AOVS = ("color", "P", "normal", "elementId", "primId")


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    return stage


def test_catmull_clark_cube_has_its_limit_height(stage):
    add_cube(stage, half=1.5)
    image = render(stage, aovs=AOVS, width=41, height=41, samples=16)
    # Limit of a cube's face centre: (16 + 4 * 3 + 4 * 5 / 9) / 36 of the half edge.
    height = (16 + 12 + 20 / 9) / 36 * 1.5
    assert image["P"][20, 20][2] == pytest.approx(height, abs=5e-3)
    np.testing.assert_allclose(image["normal"][20, 20], [0, 0, 1], atol=0.02)


def test_schemes_of_a_cube(stage):
    cube = add_cube(stage, half=1.5)
    areas = {}
    for scheme in ("none", "bilinear", "catmullClark"):
        cube.GetSubdivisionSchemeAttr().Set(scheme)
        areas[scheme] = render(stage, samples=64).alpha.sum()
    assert areas["none"] == pytest.approx(areas["bilinear"], rel=1e-4)
    assert areas["catmullClark"] < 0.8 * areas["none"]


def test_sharp_creases_bring_the_cube_back(stage):
    cube = add_cube(stage, half=1.5)
    edges = [0, 1, 1, 3, 3, 2, 2, 0, 4, 6, 6, 7, 7, 5, 5, 4, 0, 4, 1, 5, 2, 6, 3, 7]
    cube.CreateCreaseIndicesAttr(edges)
    cube.CreateCreaseLengthsAttr([2] * 12)
    cube.CreateCreaseSharpnessesAttr([10.0] * 12)
    creased = render(stage, samples=64).alpha
    cube.GetSubdivisionSchemeAttr().Set("none")
    np.testing.assert_allclose(creased, render(stage, samples=64).alpha, atol=0.05)


def test_sharp_corners_reach_out(stage):
    cube = add_cube(stage, half=1.5)
    smooth = render(stage, samples=64).alpha.sum()
    cube.CreateCornerIndicesAttr(list(range(8)))
    cube.CreateCornerSharpnessesAttr([10.0] * 8)
    assert render(stage, samples=64).alpha.sum() > 1.02 * smooth


def test_holes(stage):
    grid = add_grid(stage, n=4, scheme="catmullClark")
    grid.CreateHoleIndicesAttr([5, 10])
    image = render(stage, aovs=AOVS)
    expected = quad_coverage(-2, -2, 2, 2)
    expected -= quad_coverage(-1, -1, 0, 0) + quad_coverage(0, 0, 1, 1)
    np.testing.assert_array_equal(image.alpha, expected)
    assert set(np.unique(image["elementId"])) == {-1, *range(16)} - {5, 10}


@pytest.mark.parametrize(
    ("boundary", "area"),
    [("edgeAndCorner", 16.0), ("edgeOnly", None), ("none", 16.0 / 9)],
)
def test_interpolate_boundary(stage, boundary, area):
    grid = add_grid(stage, n=3, scheme="catmullClark")
    grid.CreateInterpolateBoundaryAttr(boundary)
    image = render(stage, samples=64)
    covered = image.alpha.sum() / 16
    if area is None:  # rounded corners: more than the disk that fits, less than the square
        assert 14.0 < covered < 15.95
    else:
        assert covered == pytest.approx(area, rel=2e-3)


def test_loop_octahedron_lies_inside_its_hull(stage):
    points = [(2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2)]
    faces = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5]
    mesh = add_mesh(stage, "/loop", points, [3] * 8, faces, "loop")
    image = render(stage, aovs=AOVS, width=41, height=41, samples=16)
    # Valence 4: beta = 31 / 256 (Loop's); limit weight of the vertex 1 / (1 + 4 * 8 / 3 * beta).
    cosine = 0.375 + 0.25 * np.cos(2 * np.pi / 4)
    beta = (0.625 - cosine**2) / 4
    own = 1 / (1 + 4 * (1 / (3 / 8 / beta)))
    assert image["P"][20, 20][2] == pytest.approx(2 * own, abs=0.02)
    mesh.GetSubdivisionSchemeAttr().Set("none")
    assert image.alpha.sum() < render(stage, samples=16, width=41, height=41).alpha.sum()


def test_triangle_rule_changes_triangles(stage):
    points = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0), (0, 0, 2)]
    mesh = add_mesh(
        stage, "/fan", points, [3] * 4, [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4], "catmullClark"
    )
    first = render(stage, aovs=AOVS)["P"]
    mesh.CreateTriangleSubdivisionRuleAttr("smooth")
    assert np.abs(render(stage, aovs=AOVS)["P"] - first).max() > 1e-3


def test_left_handed_subdivision(stage):
    grid = add_grid(stage, n=3, scheme="catmullClark")
    grid.CreateOrientationAttr("leftHanded")
    image = render(stage, aovs=AOVS)
    np.testing.assert_allclose(image["normal"][pixel(0.1, 0.1)], [0, 0, -1], atol=5e-3)


@pytest.mark.parametrize(
    "rule", ["none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"]
)
def test_face_varying_rules_are_taken(stage, rule):
    grid = add_grid(stage, n=2, scheme="catmullClark")
    grid.CreateFaceVaryingLinearInterpolationAttr(rule)
    primvar = grid.CreateDisplayColorPrimvar("faceVarying")
    ramp = [Gf.Vec3f(x, 0, 0) for _ in range(2) for x in (0.0, 0.5, 0.5, 0.0, 0.5, 1.0, 1.0, 0.5)]
    primvar.Set(ramp)
    image = render(stage)
    assert image.warnings == []
    left, right = image["color"][pixel(-1.4, 1)][0], image["color"][pixel(1.4, 1)][0]
    assert left < right


def test_finer_shading_rate_makes_more_micropolygons(stage):
    add_cube(stage)
    coarse = render(stage, shading_rate=2.0).statistics["micropolygons"]
    fine = render(stage, shading_rate=0.5).statistics["micropolygons"]
    assert fine > 6 * coarse
