"""Shapes land on the right pixels, with the right ids."""

import numpy as np
import pytest
from pxr import Gf, UsdGeom
from scenes import (
    SIZE,
    add_camera,
    add_cube,
    add_grid,
    add_mesh,
    add_quad,
    new_stage,
    pixel,
    quad_coverage,
    render,
)

IDS = ("color", "primId", "instanceId", "elementId", "sampleCount")


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    return stage


def test_quad_on_pixel_edges_is_exact(stage):
    add_quad(stage)
    image = render(stage, aovs=IDS)
    covered = quad_coverage(-2, -2, 2, 2)
    assert set(np.unique(covered)) == {0.0, 1.0}
    np.testing.assert_array_equal(image.alpha, covered)
    np.testing.assert_array_equal(image["primId"], np.where(covered == 1, 0, -1))
    np.testing.assert_array_equal(image["elementId"], np.where(covered == 1, 0, -1))
    np.testing.assert_array_equal(image["instanceId"] >= 0, covered == 1)
    assert (image["sampleCount"] == 4).all()
    assert image.warnings == []


def test_quad_between_pixels_covers_them_in_part(stage):
    add_quad(stage, x0=-1.9, y0=-2.05, x1=2.13, y1=1.7)
    image = render(stage, samples=256)
    np.testing.assert_allclose(image.alpha, quad_coverage(-1.9, -2.05, 2.13, 1.7), atol=0.02)


def test_nearer_quads_hide_others_and_ids_tell_them_apart(stage):
    add_quad(stage, "/back", -3, -3, 3, 3, z=-1)
    add_quad(stage, "/front", -1, -1, 1, 1, z=1)
    image = render(stage, aovs=IDS)
    paths = image.prim_paths
    assert paths[image["primId"][pixel(0.1, 0.1)]] == "/front"
    assert paths[image["primId"][pixel(2, 2, -1)]] == "/back"
    assert image["primId"][0, 0] == -1


def test_element_is_the_authored_face(stage):
    add_grid(stage, n=4)
    image = render(stage, aovs=IDS)
    for row in range(4):
        for column in range(4):
            at = pixel(column - 1.5, row - 1.5)
            assert image["elementId"][at] == row * 4 + column


def test_image_is_upright_and_not_mirrored(stage):
    add_quad(stage, x0=1, y0=2, x1=3, y1=4)
    rows, columns = np.nonzero(render(stage).alpha)
    assert (rows.min(), rows.max()) == (4, 11)
    assert (columns.min(), columns.max()) == (24, 31)


def test_triangles_quads_and_concave_polygons(stage):
    outline = [(-3, -3), (3, -3), (3, 0), (0, 0), (0, 3), (-3, 3)]
    points = [(x, y, 0) for x, y in outline] + [(1, 1, 0), (4, 1, 0), (1, 4, 0)]
    add_mesh(stage, "/shape", points, [6, 3], [0, 1, 2, 3, 4, 5, 6, 7, 8])
    image = render(stage, aovs=IDS, samples=64)
    inside = quad_coverage(-3, -3, 3, 0) + quad_coverage(-3, 0, 0, 3)
    corner = np.zeros((SIZE, SIZE), dtype=bool)
    corner[4:16, 24:36] = True  # the triangle's box
    np.testing.assert_array_equal(image.alpha[~corner], inside[~corner])
    assert image["elementId"][pixel(1.5, 1.5)] == 1
    assert image.alpha[pixel(3.5, 3.5)] == 0
    np.testing.assert_allclose(image.alpha[corner].sum(), 0.5 * 12 * 12, rtol=0.02)


def test_cube_and_plane_prims(stage):
    UsdGeom.Cube.Define(stage, "/cube").CreateSizeAttr(2.0)
    plane = UsdGeom.Plane.Define(stage, "/plane")
    plane.CreateWidthAttr(8.0)
    plane.CreateLengthAttr(6.0)
    plane.CreateAxisAttr("Z")
    plane.AddTranslateOp().Set(Gf.Vec3d(0, 0, -2.5))
    image = render(stage, aovs=IDS)
    near = quad_coverage(-1, -1, 1, 1, z=1)
    far = quad_coverage(-4, -3, 4, 3, z=-2.5)
    assert (image.alpha[near == 1] == 1).all()
    assert image.prim_paths[image["primId"][pixel(0.1, 0.1)]] == "/cube"
    assert image.prim_paths[image["primId"][pixel(3, 2, -2.5)]] == "/plane"
    np.testing.assert_array_equal(image.alpha[far == 0], 0)
    np.testing.assert_array_equal(image.alpha[far == 1], 1)
    assert image.warnings == []


def test_cube_mesh_of_every_scheme_is_closed(stage):
    for i, scheme in enumerate(("none", "bilinear", "catmullClark")):
        cube = add_cube(stage, f"/cube{i}", half=0.9, scheme=scheme)
        cube.AddTranslateOp().Set(Gf.Vec3d(3 * i - 3, 0, 0))
        cube.AddRotateXYZOp().Set(Gf.Vec3f(31, 17, 5))
    alpha = render(stage, samples=16).alpha
    # No holes: in each row the covered pixels of one cube follow each other.
    for i in range(3):
        part = alpha[:, i * 12 + 2 : i * 12 + 14] > 0.99
        for row in part:
            where = np.flatnonzero(row)
            assert len(where) == 0 or len(where) == where[-1] - where[0] + 1


def test_visibility_purpose_and_activity(stage):
    add_quad(stage, "/seen", -4, -4, -3, -3)
    add_quad(stage, "/hidden/child", -2, -4, -1, -3)
    UsdGeom.Imageable.Get(stage, "/hidden/child").MakeVisible()
    UsdGeom.Xform.Define(stage, "/hidden").MakeInvisible()
    for i, purpose in enumerate(("proxy", "render", "guide")):
        parent = UsdGeom.Xform.Define(stage, f"/{purpose}")
        parent.CreatePurposeAttr(purpose)
        add_quad(stage, f"/{purpose}/quad", 2 * i - 4, 0, 2 * i - 3, 1)
    add_quad(stage, "/off", 3, -4, 4, -3)
    stage.GetPrimAtPath("/off").SetActive(False)

    def seen(**settings):
        image = render(stage, aovs=IDS, **settings)
        return {image.prim_paths[i] for i in np.unique(image["primId"]) if i >= 0}

    assert seen() == {"/seen", "/proxy/quad"}
    assert seen(purposes=["render"]) == {"/seen", "/render/quad"}
    assert seen(purposes=["guide", "proxy"]) == {"/seen", "/proxy/quad", "/guide/quad"}
    assert seen(purposes=[]) == {"/seen"}
