"""Motion blur: against closed forms, between equivalent scenes, and against the oracle."""

import numpy as np
import pytest
from oracle import REPLICATES, TIMES, agree, blurred, mean_over, mean_over_times, stratified
from pxr import Gf, Usd, UsdGeom, Vt
from scenes import (
    add_camera,
    add_cube,
    add_quad,
    new_stage,
    quad_coverage,
    quad_points,
    render,
    set_samples,
)

SAMPLES = 256
MOVE = Gf.Vec3d(3, 1, 0)


def moving_stage(level="own"):
    """A quad that moves by MOVE from time 0 to 1, by `level`: which part of the scene moves."""
    stage = new_stage()
    camera = add_camera(stage)
    UsdGeom.Xform.Define(stage, "/a")
    UsdGeom.Xform.Define(stage, "/a/b")
    quad = add_quad(stage, "/a/b/quad", -3, -2, 0, 1)
    keys = {0: Gf.Vec3d(0), 1: MOVE}
    if level in ("own", "parent", "grandparent"):
        path = {"own": "/a/b/quad", "parent": "/a/b", "grandparent": "/a"}[level]
        xform = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        set_samples(xform.AddTranslateOp().GetAttr(), keys)
    elif level == "points":
        moved = [np.add(p, MOVE) for p in quad_points(-3, -2, 0, 1)]
        for time, points in ((0, quad_points(-3, -2, 0, 1)), (1, moved)):
            quad.GetPointsAttr().Set(
                Vt.Vec3fArray([Gf.Vec3f(*map(float, p)) for p in points]), time
            )
    elif level == "velocities":
        quad.GetPointsAttr().Set(quad.GetPointsAttr().Get(), 0)
        quad.CreateVelocitiesAttr().Set(Vt.Vec3fArray([Gf.Vec3f(MOVE) * 24] * 4), 0)
    elif level == "camera":
        keys = {time: -value for time, value in keys.items()}
        set_samples(camera.AddTranslateOp(opSuffix="move").GetAttr(), keys)
    return stage


LEVELS = ("own", "parent", "grandparent", "points", "velocities", "camera")


@pytest.mark.parametrize("level", LEVELS)
def test_a_moving_quad_covers_what_it_should(level):
    alpha = render(moving_stage(level), shutter=(0, 1), samples=SAMPLES).alpha
    times = (np.arange(512) + 0.5) / 512
    x, y = times * MOVE[0], times * MOVE[1]
    frames = [quad_coverage(-3 + dx, -2 + dy, dx, 1 + dy) for dx, dy in zip(x, y, strict=True)]
    expected = np.mean(frames, axis=0)
    np.testing.assert_allclose(alpha, expected, atol=0.03)
    assert abs(alpha.sum() - expected.sum()) < 0.003 * expected.sum()


@pytest.mark.parametrize("level", LEVELS)
def test_blur_off_is_the_scene_at_the_frame(level):
    stage = moving_stage(level)
    centred = {"shutter": (-0.5, 0.5), "motion_blur": False}
    for frame, corner in ((0.0, (-3, -2, 0, 1)), (1.0, (0, -1, 3, 2))):
        alpha = render(stage, frame=frame, **centred).alpha
        np.testing.assert_array_equal(alpha, quad_coverage(*corner))


@pytest.mark.parametrize("level", ("own", "points", "camera"))
def test_a_held_stage_shows_the_frame_it_is_on(level):
    stage = moving_stage(level)
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    alpha = render(stage, frame=1.0, shutter=(-0.25, 0.25), samples=16).alpha
    np.testing.assert_array_equal(alpha, quad_coverage(0, -1, 3, 2))


def test_the_cameras_shutter_is_used_and_can_be_overridden():
    stage = moving_stage()
    still = render(stage).alpha
    np.testing.assert_array_equal(still, quad_coverage(-3, -2, 0, 1))
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.CreateShutterOpenAttr(0.0)
    camera.CreateShutterCloseAttr(1.0)
    blurred = render(stage, samples=16).alpha
    assert ((blurred > 0) & (blurred < 1)).sum() > 50
    np.testing.assert_array_equal(blurred, render(stage, samples=16, shutter=(0, 1)).alpha)
    np.testing.assert_array_equal(render(stage, shutter=(0, 0)).alpha, still)


def test_shutter_is_relative_to_the_frame():
    stage = moving_stage()
    a = render(stage, frame=0.0, shutter=(0.25, 0.75), samples=16).alpha
    b = render(stage, frame=1.0, shutter=(-0.75, -0.25), samples=16).alpha
    np.testing.assert_array_equal(a, b)


def test_inner_keys_are_not_lost():
    # There and back: with the two ends alone, nothing would move.
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage, x0=-1, y0=-1, x1=1, y1=1)
    keys = {0: Gf.Vec3d(0), 0.5: Gf.Vec3d(2, 0, 0), 1: Gf.Vec3d(0)}
    set_samples(quad.AddTranslateOp().GetAttr(), keys)
    alpha = render(stage, shutter=(0, 1), samples=SAMPLES).alpha
    expected = np.mean(
        [quad_coverage(-1 + d, -1, 1 + d, 1) for d in 2 * (np.arange(256) + 0.5) / 256], axis=0
    )
    np.testing.assert_allclose(alpha, expected, atol=0.03)


def rotate(degrees):
    def author(stage):
        cube = add_cube(stage, half=1.2, scheme="catmullClark", color=(1, 0.5, 0.2))
        cube.AddTranslateOp().Set(Gf.Vec3d(0.5, 0, 0))
        set_samples(cube.AddRotateXYZOp().GetAttr(), {0: Gf.Vec3f(0), 1: Gf.Vec3f(10, 20, degrees)})
        cube.AddTranslateOp(opSuffix="arm").Set(Gf.Vec3d(2, 0, 0))
        return UsdGeom.XformOp(cube.GetPrim().GetAttribute("xformOp:rotateXYZ")).GetAttr()

    return author


def translate(stage):
    cube = add_cube(stage, half=1.2, scheme="none", color=(1, 0.5, 0.2))
    op = cube.AddTranslateOp()
    set_samples(op.GetAttr(), {0: Gf.Vec3d(-2, 0, 0), 0.4: Gf.Vec3d(0, 1, 0), 1: Gf.Vec3d(2, 0, 1)})
    return op.GetAttr()


def nested(stage):
    outer = UsdGeom.Xform.Define(stage, "/outer")
    op = outer.AddTranslateOp()
    set_samples(op.GetAttr(), {0: Gf.Vec3d(-1, 0, 0), 1: Gf.Vec3d(1, 1, 0)})
    add_cube(stage, "/outer/cube", half=1.0)
    cube = UsdGeom.Xformable.Get(stage, "/outer/cube")
    set_samples(cube.AddRotateZOp().GetAttr(), {0: 0.0, 1: 80.0})
    scale = cube.AddScaleOp()
    set_samples(scale.GetAttr(), {0: Gf.Vec3f(1, 1, 1), 1: Gf.Vec3f(2, 1, 1)})
    return op.GetAttr()


def deform(stage):
    cube = add_cube(stage, half=1.2, color=(1, 0.5, 0.2))
    points = np.array(cube.GetPointsAttr().Get())
    bent = points * np.array([1.5, 0.6, 1.0]) + np.array([1.0, 0.4, 0.0])
    attribute = cube.GetPointsAttr()
    attribute.Set(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)), 0)
    attribute.Set(Vt.Vec3fArray.FromNumpy((points + np.array([0, 1.5, 0])).astype(np.float32)), 0.5)
    attribute.Set(Vt.Vec3fArray.FromNumpy(bent.astype(np.float32)), 1)
    return attribute


def camera_moves(stage):
    add_cube(stage, half=1.2, color=(1, 0.5, 0.2))
    add_quad(stage, "/far", -4, -4, 4, -3, z=-6)
    op = UsdGeom.Camera.Get(stage, "/camera").AddTranslateOp(opSuffix="move")
    set_samples(op.GetAttr(), {0: Gf.Vec3d(-1, 0, 0), 1: Gf.Vec3d(1, 0.5, -1)})
    return op.GetAttr()


def camera_turns(stage):
    add_cube(stage, half=1.2, color=(1, 0.5, 0.2))
    op = UsdGeom.Camera.Get(stage, "/camera").AddRotateXYZOp()
    set_samples(op.GetAttr(), {0: Gf.Vec3f(0, -8, 0), 1: Gf.Vec3f(5, 8, 60)})
    return op.GetAttr()


def camera_and_object(stage):
    moving = camera_moves(stage)
    cube = UsdGeom.Xformable.Get(stage, "/cube")
    set_samples(cube.AddRotateYOp().GetAttr(), {0: 0.0, 1: 70.0})
    return moving


MOTIONS = {
    "translate": translate,
    "rotate": rotate(40.0),
    "rotate far": rotate(170.0),
    "nested": nested,
    "deform": deform,
    "camera moves": camera_moves,
    "camera turns": camera_turns,
    "camera and object": camera_and_object,
}


def authored(name):
    stage = new_stage()
    add_camera(stage)
    return stage, MOTIONS[name](stage)


@pytest.mark.parametrize("name", MOTIONS)
def test_blur_is_the_mean_over_time(name):
    stage, moving = authored(name)
    over_time = mean_over_times(stage)
    same, figures = agree(blurred(stage, shutter=(0, 1)), over_time)
    assert same, figures
    # And it can fail: with one key shifted a little, it does.
    last = moving.GetTimeSamples()[-1]
    moving.Set(shifted(moving.Get(last)), last)
    same, figures = agree(blurred(stage, shutter=(0, 1)), over_time)
    assert not same, f"a shifted key went unseen: {figures}"


def shifted(value):
    """A key with an error that is small in the picture, but not nothing."""
    if isinstance(value, float):
        return value + 25.0
    if isinstance(value, Gf.Vec3f):
        return value + Gf.Vec3f(0, 8, 12)
    if isinstance(value, Gf.Vec3d):
        return value + Gf.Vec3d(0.5, 0.3, 0)
    return Vt.Vec3fArray([v + Gf.Vec3f(0.5, 0.3, 0) for v in value])


@pytest.mark.parametrize("name", ["rotate", "deform", "camera turns"])
def test_time_window_samples_a_part_of_the_shutter(name):
    # The same over frozen dicing: one render whose samples all have the same time.
    stage, _ = authored(name)
    rng = np.random.default_rng(3)
    over_time = mean_over(
        [stratified(rng, TIMES) for _ in range(REPLICATES)],
        lambda t, seed: render(stage, shutter=(0, 1), time_window=(t, t), seed=seed)["color"],
    )
    same, figures = agree(blurred(stage, shutter=(0, 1)), over_time)
    assert same, figures


def test_defocus_is_the_mean_over_the_lens():
    stage = new_stage()
    camera = add_camera(stage, fStop=1.0, focusDistance=13.0)
    add_cube(stage, half=1.2, color=(1, 0.5, 0.2))
    add_quad(stage, "/near", -4, -4, -2, -2, z=3)
    rng = np.random.default_rng(5)

    def lens_points():
        radius = np.sqrt(stratified(rng, TIMES))
        angle = 2.399963 * np.arange(TIMES) + rng.random() * 2 * np.pi  # the golden angle
        return [
            (float(r * np.cos(a)), float(r * np.sin(a))) for r, a in zip(radius, angle, strict=True)
        ]

    over_lens = mean_over(
        [lens_points() for _ in range(REPLICATES)],
        lambda point, seed: render(stage, lens_point=point, seed=seed)["color"],
    )
    same, figures = agree(blurred(stage), over_lens)
    assert same, figures
    camera.GetFocusDistanceAttr().Set(12.0)
    same, figures = agree(blurred(stage), over_lens)
    assert not same, f"a wrong focus went unseen: {figures}"


def test_points_under_acceleration_follow_the_parabola():
    """From rest at the frame, y = a t^2 / 2: over -0.5..0.5 its mean is a / 24."""
    acceleration = 24.0
    stage = new_stage()
    stage.SetTimeCodesPerSecond(24)
    add_camera(stage, **{"shutter:open": -0.5, "shutter:close": 0.5})
    quad = add_quad(stage, x0=-0.05, y0=-0.05, x1=0.05, y1=0.05)
    quad.GetPointsAttr().Set(quad.GetPointsAttr().Get(), 0)
    quad.CreateVelocitiesAttr().Set([(6.0 * 24, 0, 0)] * 4, 0)
    quad.CreateAccelerationsAttr().Set([(0, acceleration * 24**2, 0)] * 4, 0)
    size = 200
    alpha = render(stage, frame=0.0, width=size, height=size, samples=1024).alpha
    rows = size / 2 - 0.5 - np.arange(size)
    mean = (alpha.sum(axis=1) * rows).sum() / alpha.sum()
    pixels_per_unit = size / 10
    assert mean == pytest.approx(acceleration / 24 * pixels_per_unit, rel=0.01)
