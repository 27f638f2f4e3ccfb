"""Values of the AOVs against what geometry and USD's own camera say."""

import math

import numpy as np
import pytest
from pxr import Gf, UsdGeom
from scenes import (
    add_camera,
    add_grid,
    add_quad,
    new_stage,
    pixel,
    quad_coverage,
    render,
    set_samples,
)

GEOMETRY = ("color", "depth", "cameraDepth", "P", "normal", "Neye", "primId")
IRRADIANCE = 15000.0 * 2 * math.pi * (1 - math.cos(math.radians(0.53 / 2)))


def tilted(stage):
    """A quad turned about x and y under a camera that is turned too."""
    quad = add_quad(stage)
    quad.AddTranslateOp().Set(Gf.Vec3d(0.3, -0.2, 1.0))
    quad.AddRotateXYZOp().Set(Gf.Vec3f(25, 40, 0))
    camera = add_camera(stage)
    camera.AddRotateXYZOp().Set(Gf.Vec3f(3, -5, 20))
    return quad, camera


def to_row(matrix, points):
    points = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ np.array(matrix)
    return points[..., :3] / points[..., 3:]


def test_background():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, x0=4, y0=4, x1=5, y1=5)
    image = render(stage, aovs=(*GEOMETRY, "instanceId", "elementId", "motionVectors", "cost"))
    corner = {name: values[-1, 0] for name, values in image.items()}
    assert corner["depth"] == 1
    for name in ("primId", "instanceId", "elementId"):
        assert corner[name] == -1
    for name in ("color", "cameraDepth", "P", "normal", "Neye", "motionVectors"):
        assert not np.any(corner[name])


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_position_depth_and_camera_depth(projection):
    stage = new_stage()
    quad, camera = tilted(stage)
    camera.CreateProjectionAttr(projection)
    if projection == "orthographic":
        camera.GetHorizontalApertureAttr().Set(100.0)
        camera.GetVerticalApertureAttr().Set(100.0)
    image = render(stage, aovs=GEOMETRY)
    hit = image["primId"] >= 0
    assert hit.sum() > 100
    points = image["P"][hit]
    frustum = camera.GetCamera(0).frustum
    view, projection = frustum.ComputeViewMatrix(), frustum.ComputeProjectionMatrix()
    in_camera = to_row(view, points)
    np.testing.assert_allclose(image["cameraDepth"][hit], -in_camera[:, 2], rtol=1e-5)
    clip = to_row(projection, in_camera)
    np.testing.assert_allclose(image["depth"][hit], 0.5 + 0.5 * clip[:, 2], atol=2e-6)
    # The point is on the quad, and in the pixel that saw it.
    on_quad = to_row(
        UsdGeom.XformCache(0).GetLocalToWorldTransform(quad.GetPrim()).GetInverse(), points
    )
    np.testing.assert_allclose(on_quad[:, 2], 0, atol=1e-5)
    assert np.abs(on_quad[:, :2]).max() < 2.0001
    size = image["primId"].shape[0]
    raster = np.stack([(1 - clip[:, 1]) * size / 2, (1 + clip[:, 0]) * size / 2], axis=1)
    where = np.argwhere(hit)
    assert ((raster > where - 1e-3) & (raster < where + 1 + 1e-3)).all()


def test_normals_in_world_and_camera_space():
    stage = new_stage()
    quad, camera = tilted(stage)
    image = render(stage, aovs=GEOMETRY)
    hit = image["primId"] >= 0
    cache = UsdGeom.XformCache(0)
    expected = np.array(cache.GetLocalToWorldTransform(quad.GetPrim()).TransformDir((0, 0, 1)))
    np.testing.assert_allclose(image["normal"][hit], np.tile(expected, (hit.sum(), 1)), atol=2e-3)
    to_camera = cache.GetLocalToWorldTransform(camera.GetPrim()).GetInverse()
    eye = np.array(to_camera.TransformDir(Gf.Vec3d(*expected)))
    np.testing.assert_allclose(image["Neye"][hit], np.tile(eye, (hit.sum(), 1)), atol=2e-3)


def test_left_handed_orientation_turns_the_normal():
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage)
    assert render(stage, aovs=GEOMETRY)["normal"][pixel(0, 0)][2] == pytest.approx(1, abs=1e-3)
    quad.CreateOrientationAttr("leftHanded")
    assert render(stage, aovs=GEOMETRY)["normal"][pixel(0, 0)][2] == pytest.approx(-1, abs=1e-3)


def test_authored_normals_of_polygons():
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage)
    quad.CreateNormalsAttr([Gf.Vec3f(0.6, 0, 0.8)] * 4)
    quad.SetNormalsInterpolation("vertex")
    np.testing.assert_allclose(
        render(stage, aovs=GEOMETRY)["normal"][pixel(0, 0)], [0.6, 0, 0.8], atol=2e-3
    )


def test_motion_vectors():
    stage = new_stage()
    add_camera(stage, shutter__open=0.0, shutter__close=0.5)
    quad = add_quad(stage)
    set_samples(quad.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 1: Gf.Vec3d(2, 1, 0)})
    image = render(stage, aovs=("color", "motionVectors"))
    # Half a frame: one unit to the right, half a unit up; 4 pixels a unit, y down.
    np.testing.assert_allclose(image["motionVectors"][pixel(0.5, 0.3)], [4, -2], atol=1e-3)


def test_motion_vectors_of_a_moving_camera():
    stage = new_stage()
    camera = add_camera(stage, shutter__open=0.0, shutter__close=1.0)
    set_samples(
        camera.AddTranslateOp(opSuffix="move").GetAttr(), {0: Gf.Vec3d(0), 1: Gf.Vec3d(1, 0, 0)}
    )
    add_quad(stage)
    image = render(stage, aovs=("color", "motionVectors"))
    np.testing.assert_allclose(image["motionVectors"][pixel(0, 0)], [-4, 0], atol=1e-3)


def test_camera_light():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, color=(0.5, 0.25, 1.0))
    lit = render(stage)["color"][pixel(0, 0)]
    np.testing.assert_allclose(
        lit, [*(np.array([0.5, 0.25, 1.0]) * IRRADIANCE / math.pi), 1], rtol=2e-3
    )
    dark = render(stage, camera_light=False)["color"][pixel(0, 0)]
    np.testing.assert_array_equal(dark, [0, 0, 0, 1])


def test_opacity_is_premultiplied_and_shows_what_is_behind():
    stage = new_stage()
    add_camera(stage)
    front = add_quad(stage, "/front", -2, -2, 2, 2, z=1, color=(1, 0, 0))
    front.CreateDisplayOpacityAttr([0.25])
    add_quad(stage, "/back", 0, -1.5, 3, 1.5, z=0, color=(0, 1, 0))
    color = render(stage, aovs=("color", "primId"))["color"]
    k = IRRADIANCE / math.pi
    np.testing.assert_allclose(color[pixel(-1, 0, 1)], [0.25 * k, 0, 0, 0.25], rtol=2e-3)
    np.testing.assert_allclose(color[pixel(1, 0, 1)], [0.25 * k, 0.75 * k, 0, 1], rtol=2e-3)


def test_opacity_zero_is_not_there():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage).CreateDisplayOpacityAttr([0.0])
    image = render(stage, aovs=GEOMETRY)
    assert not image["color"].any()
    assert (image["primId"] == -1).all()
    assert (image["depth"] == 1).all()


def test_alpha_of_an_edge_scales_color():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, x0=-1.9, y0=-1.9, x1=1.9, y1=1.9)
    color = render(stage, samples=64)["color"]
    partly = (color[..., 3] > 0.1) & (color[..., 3] < 0.9)
    assert partly.sum() > 20
    np.testing.assert_allclose(
        color[partly][:, 0] / color[partly][:, 3], IRRADIANCE / math.pi, rtol=2e-3
    )


def test_ids_are_never_averaged():
    stage = new_stage()
    add_camera(stage)
    add_grid(stage, n=7, half=2.3)
    image = render(stage, aovs=("color", "elementId", "P"), samples=64, filter="gaussian")
    edges = np.linspace(-2.3, 2.3, 8)
    for row, column in np.argwhere(image["elementId"] >= 0):
        x, y, _ = image["P"][row, column]
        face = image["elementId"][row, column]
        i, j = np.searchsorted(edges, [x, y]) - 1
        near_edge = min(np.abs(edges - x).min(), np.abs(edges - y).min()) < 1e-4
        assert face == j * 7 + i or near_edge


def test_filters_keep_the_sum():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, x0=-1.9, y0=-1.9, x1=1.8, y1=1.7)
    expected = quad_coverage(-1.9, -1.9, 1.8, 1.7).sum()
    for name in ("box", "gaussian", "mitchell", "blackman-harris"):
        image = render(stage, samples=256, filter=name)
        assert image.alpha.sum() == pytest.approx(expected, rel=0.01), name
        assert image.alpha[pixel(0, 0)] == pytest.approx(1, abs=1e-3), name
    wide = render(stage, samples=256, filter="box", filter_width=3.0).alpha
    soft = (wide > 0.01) & (wide < 0.99)
    assert soft.sum() > 1.5 * ((expected**0.5) * 4)
