"""Projections, windows, clipping and lenses of cameras."""

import numpy as np
import pytest
from pxr import Gf, UsdGeom
from scenes import add_camera, add_quad, new_stage, quad_coverage, render, set_samples


def test_orthographic_does_not_shrink_with_distance():
    stage = new_stage()
    add_camera(stage, projection="orthographic", horizontalAperture=100.0, verticalAperture=100.0)
    add_quad(stage, "/near", -3, -3, -1, -1, z=3)
    add_quad(stage, "/far", 1, 1, 3, 3, z=-30)
    alpha = render(stage).alpha
    np.testing.assert_array_equal(alpha, quad_coverage(-3, -3, -1, -1) + quad_coverage(1, 1, 3, 3))


def test_aperture_offsets_move_the_window():
    stage = new_stage()
    add_camera(stage, horizontalApertureOffset=2.0, verticalApertureOffset=-3.0)
    add_quad(stage)
    # A tenth of the width to the right, 0.15 of the height down.
    np.testing.assert_array_equal(render(stage).alpha, quad_coverage(-3, -0.5, 1, 3.5))


@pytest.mark.parametrize(
    ("policy", "x_scale", "y_scale"),
    [
        ("matchHorizontally", 8, 8),
        ("matchVertically", 4, 4),
        ("fit", 4, 4),
        ("crop", 8, 8),
        ("dontConform", 8, 4),
    ],
)
def test_window_policies(policy, x_scale, y_scale):
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, x0=-1, y0=-1, x1=1, y1=1)
    alpha = render(stage, width=80, height=40, window_policy=policy).alpha
    rows, columns = np.nonzero(alpha)
    assert (columns.min(), columns.max()) == (40 - x_scale, 39 + x_scale)
    assert (rows.min(), rows.max()) == (20 - y_scale, 19 + y_scale)


def test_height_follows_the_aspect():
    stage = new_stage()
    add_camera(stage, horizontalAperture=20.0, verticalAperture=15.0)
    add_quad(stage)
    assert render(stage, height=None).alpha.shape == (30, 40)


def test_height_is_not_rounded_down():
    """24 by 16 is 1.5, also in tenths."""
    stage = new_stage()
    add_camera(stage, horizontalAperture=24.0, verticalAperture=16.0)
    add_quad(stage)
    assert render(stage, width=96, height=None).alpha.shape == (64, 96)


def test_clipping():
    stage = new_stage()
    add_camera(stage, clippingRange=Gf.Vec2f(9.0, 12.0))
    add_quad(stage, "/too_near", -4, -4, 4, 4, z=1.5)
    add_quad(stage, "/seen", -2, -2, 2, 2, z=0)
    add_quad(stage, "/too_far", -9, -9, 9, 9, z=-3)
    np.testing.assert_array_equal(render(stage).alpha, quad_coverage(-2, -2, 2, 2))


def test_exposure():
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage)
    plain = render(stage)["color"]
    camera.GetExposureAttr().Set(2.0)
    brighter = render(stage)["color"]
    np.testing.assert_allclose(brighter[..., :3], 4 * plain[..., :3], rtol=1e-5)
    np.testing.assert_array_equal(brighter[..., 3], plain[..., 3])


def test_what_is_in_focus_is_sharp():
    stage = new_stage()
    add_camera(stage, fStop=0.5, focusDistance=10.0)
    add_quad(stage)
    np.testing.assert_allclose(
        render(stage, samples=16).alpha, quad_coverage(-2, -2, 2, 2), atol=1e-3
    )


def test_what_is_out_of_focus_is_blurred_by_the_circle_of_confusion():
    stage = new_stage()
    # Lens radius 2 / (2 * 1) = 1; in focus at 20, the blur circle at 10 has radius 0.5 units.
    camera = add_camera(stage, fStop=1.0, focusDistance=20.0)
    add_quad(stage)
    alpha = render(stage, samples=256).alpha
    row = alpha[20]
    edge = 28  # x = 2
    outside = np.flatnonzero(row > 0.004).max()
    inside = np.flatnonzero(row > 0.996).max()
    assert outside == edge + 1
    assert inside == edge - 3
    # Half covered at the edge, and the area of a disk's segment beyond.
    assert row[edge - 1] + row[edge] == pytest.approx(1.0, abs=0.02)
    assert alpha.sum() / 16 == pytest.approx(16.0, rel=0.01)
    camera.GetFStopAttr().Set(0.0)
    np.testing.assert_array_equal(render(stage).alpha, quad_coverage(-2, -2, 2, 2))
    camera.GetFStopAttr().Set(1.0)
    np.testing.assert_array_equal(render(stage, defocus=False).alpha, quad_coverage(-2, -2, 2, 2))


def test_camera_hierarchy_and_animation_place_the_camera():
    stage = new_stage()

    rig = UsdGeom.Xform.Define(stage, "/rig")
    set_samples(rig.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 10: Gf.Vec3d(10, 0, 0)})
    add_camera(stage, "/rig/camera")
    add_quad(stage)
    alpha = render(stage, frame=2.0, camera="/rig/camera").alpha
    np.testing.assert_array_equal(alpha, quad_coverage(-4, -2, 0, 2))


def test_framing_shows_everything():
    stage = new_stage()
    add_quad(stage, x0=50, y0=60, x1=58, y1=66, z=3)
    image = render(stage, height=None)
    assert image.alpha.shape == (29, 40)
    rows, columns = np.nonzero(image.alpha)
    assert rows.min() > 0
    assert rows.max() < 28
    assert columns.min() > 0
    assert columns.max() < 39
    assert abs((columns.min() + columns.max()) / 2 - 19.5) <= 1
