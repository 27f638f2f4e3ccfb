"""Transforms, cameras and instances as they are read from a stage; no rendering."""

import math

import numpy as np
import pytest
from hdtrapeze import Options, Renderer, SceneError
from hdtrapeze.camera import (
    effective_shutter,
    find_camera,
    framing_camera,
    named_camera,
    read_camera,
)
from hdtrapeze.log import SceneLog
from hdtrapeze.shutter import Shutter, bracketing_samples
from hdtrapeze.transforms import MAX_KEYS, TOLERANCE, TransformReader, compose, curve_keys
from pxr import Gf, Sdf, UsdGeom, UsdRender
from scenes import add_camera, add_quad, new_stage, set_samples


def world(stage, path, shutter, time):
    levels = TransformReader(shutter, SceneLog()).levels(stage.GetPrimAtPath(path))
    return compose(levels, time), levels


def usd_world(stage, path, time):
    cache = UsdGeom.XformCache(time)
    return np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(path)))


def test_static_levels_are_folded():
    stage = new_stage()
    for path in ("/a", "/a/b", "/a/b/c"):
        UsdGeom.Xform.Define(stage, path).AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    matrix, levels = world(stage, "/a/b/c", Shutter(0.0, 0.0, 1.0), 0.5)
    assert len(levels) == 1
    np.testing.assert_allclose(matrix, usd_world(stage, "/a/b/c", 0), atol=1e-12)


def test_levels_keep_their_own_keys():
    stage = new_stage()
    outer = UsdGeom.Xform.Define(stage, "/a")
    set_samples(outer.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 2: Gf.Vec3d(4, 0, 0)})
    inner = UsdGeom.Xform.Define(stage, "/a/b")
    set_samples(
        inner.AddTranslateOp().GetAttr(),
        {0: Gf.Vec3d(0), 0.3: Gf.Vec3d(0, 3, 0), 2: Gf.Vec3d(0)},
    )
    shutter = Shutter(0.0, 0.0, 2.0)
    _, levels = world(stage, "/a/b", shutter, 0.0)
    assert [list(level.times) for level in levels] == [[0, 0.3, 2], [0, 2]]
    for time in (0.0, 0.3, 1.0, 1.7, 2.0):
        expected = usd_world(stage, "/a/b", time)
        np.testing.assert_allclose(compose(levels, time), expected, atol=1e-12)


@pytest.mark.parametrize("degrees", [20.0, 90.0, 180.0, 350.0])
def test_rotation_follows_the_arc(degrees):
    stage = new_stage()
    xform = UsdGeom.Xform.Define(stage, "/a")
    xform.AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    set_samples(xform.AddRotateZOp().GetAttr(), {0: 0.0, 10: degrees * 10})
    xform.AddTranslateOp(opSuffix="pivot").Set(Gf.Vec3d(2, 0, 0))
    shutter = Shutter(3.0, -0.5, 0.5)
    _, levels = world(stage, "/a", shutter, 0.0)
    keys = levels[0].times
    assert keys[0] == -0.5
    assert keys[-1] == 0.5
    assert 3 <= len(keys) <= MAX_KEYS
    # With all keys used, a segment of a full turn has a sagitta of (pi / 63)^2 / 2.
    tolerance = max(TOLERANCE * 4.0, (math.pi / (MAX_KEYS - 1)) ** 2 * 2.0)
    for time in np.linspace(-0.5, 0.5, 41):
        expected = usd_world(stage, "/a", 3.0 + time)
        np.testing.assert_allclose(compose(levels, time), expected, atol=1.01 * tolerance)


def test_curves_that_cross_their_chord_are_seen():
    def evaluate(time):
        matrix = np.eye(4)
        matrix[3, 0] = math.sin(2 * math.pi * time)
        return matrix

    times, _ = curve_keys([0.0, 1.0], evaluate)
    assert len(times) > 8


def test_nothing_that_moves_has_one_key():
    times, matrices = curve_keys([0.0, 0.5, 1.0], lambda _: np.eye(4))
    assert len(times) == len(matrices) == 1


def test_reset_of_the_stack():
    stage = new_stage()
    UsdGeom.Xform.Define(stage, "/a").AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    inner = UsdGeom.Xform.Define(stage, "/a/b")
    inner.AddTranslateOp().Set(Gf.Vec3d(1, 0, 0))
    inner.SetResetXformStack(True)
    UsdGeom.Xform.Define(stage, "/a/b/c").AddTranslateOp().Set(Gf.Vec3d(0, 1, 0))
    matrix, _ = world(stage, "/a/b/c", Shutter(0.0), 0.0)
    np.testing.assert_array_equal(matrix[3, :3], [1, 1, 0])


def test_samples_bracket_the_shutter():
    stage = new_stage()
    mesh = add_quad(stage)
    points = mesh.GetPointsAttr()
    value = points.Get()
    for time in range(10):
        points.Set(value, time)
    assert bracketing_samples(points, Shutter(4.0, -0.25, 0.25)) == [3, 4, 5]
    assert bracketing_samples(points, Shutter(4.0, 0.0, 1.0)) == [4, 5]
    assert bracketing_samples(points, Shutter(4.0, 0.1, 0.2)) == [4, 5]
    assert bracketing_samples(points, Shutter(20.0, 0.0, 1.0)) is None
    assert bracketing_samples(points, Shutter(4.0)) is None


def test_camera_units():
    stage = new_stage()
    camera = add_camera(
        stage,
        fStop=2.8,
        focusDistance=7.0,
        horizontalApertureOffset=3.0,
        shutter__open=-0.25,
        shutter__close=0.25,
        exposure=1.0,
    )
    shutter = effective_shutter(camera, 4.0, None, False, SceneLog())
    state = read_camera(camera, shutter, TransformReader(shutter, SceneLog()), SceneLog())
    assert state.horizontal_aperture == pytest.approx(2.0)
    assert state.focal_length == pytest.approx(2.0)
    assert state.horizontal_aperture_offset == pytest.approx(0.3)
    assert state.focus_distance == 7.0
    assert state.f_stop == pytest.approx(2.8)
    assert state.shutter == (-0.25, 0.25)
    assert state.exposure_scale == pytest.approx(2.0)


def test_which_camera():
    stage = new_stage()
    log = SceneLog()
    assert find_camera(stage, None, None, log) is None
    add_camera(stage, "/rig/other")
    assert find_camera(stage, None, None, log) is None
    add_camera(stage, "/rig/main_cam")
    assert find_camera(stage, None, None, log).GetPath() == "/rig/main_cam"
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateCameraRel().SetTargets([Sdf.Path("/rig/other")])
    assert find_camera(stage, None, settings, log).GetPath() == "/rig/other"
    assert find_camera(stage, "main_cam", settings, log).GetPath() == "/rig/main_cam"
    assert find_camera(stage, "/rig/main_cam", settings, log).GetPath() == "/rig/main_cam"


@pytest.mark.parametrize("wanted", ["/nowhere", "/rig", "nobody"])
def test_a_camera_that_is_not_there(wanted):
    stage = new_stage()
    add_camera(stage, "/rig/other")
    with pytest.raises(SceneError, match=wanted):
        named_camera(stage, wanted)


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_framing(up):
    stage = new_stage()
    UsdGeom.SetStageUpAxis(stage, up)
    add_quad(stage, x0=0, y0=0, x1=8, y1=6)
    state = framing_camera(stage, Shutter(0.0), ["default"])
    matrix = state.levels[0].matrices[0]
    half_view = math.atan(0.5 * state.horizontal_aperture / state.focal_length)
    if up == "Y":
        distance = 5.0 / math.tan(half_view)
        np.testing.assert_allclose(matrix[3, :3], [4, 3, distance], rtol=1e-6)
        np.testing.assert_array_equal(matrix[:3, :3], np.eye(3))
    else:
        distance = 4.0 / math.tan(half_view) + 3.0
        np.testing.assert_allclose(matrix[3, :3], [4, 3 - distance, 0], rtol=1e-6)
        np.testing.assert_array_equal(-matrix[2, :3], [0, 1, 0])  # looks along +y
        np.testing.assert_array_equal(matrix[1, :3], [0, 0, 1])  # z is up


def test_shutter_that_closes_before_it_opens():
    log = SceneLog()
    stage = new_stage()
    camera = add_camera(stage, shutter__open=0.5, shutter__close=-0.5)
    shutter = effective_shutter(camera, 1.0, None, False, log)
    assert (shutter.open, shutter.close) == (0.5, 0.5)
    assert [w[0] for w in log.warnings] == ["/camera"]


def test_default_time_has_no_motion():
    stage = new_stage()
    camera = add_camera(stage, shutter__open=-0.5, shutter__close=0.5)
    shutter = effective_shutter(camera, None, None, False, SceneLog())
    assert not shutter.moves


def test_double_sided_prims_are_sent_as_such():
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage)
    with Renderer(Options(width=8, height=8, camera="/camera")) as renderer:
        for value in (None, True, False):
            if value is not None:
                quad.CreateDoubleSidedAttr().Set(value)
            renderer.load(stage, 0.0)
            assert ("double sided" in renderer.session.dump()) == bool(value)
