"""Points that velocities and accelerations move, against UsdGeom.PointBased.ComputePointsAtTime."""

import re

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from oracle import agree, blurred
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from scenes import (
    add_camera,
    add_mesh,
    add_quad,
    new_stage,
    one_warning,
    quad_coverage,
    quad_points,
    render,
    set_samples,
)

SHUTTERS = ((0.0, 0.0), (-0.25, 0.25), (0.25, 0.75), (-0.75, -0.5), (0.0, 2.5))
FRAMES = (-1.0, 0.0, 0.3, 1.0, 2.4, 3.0, 7.0)


def points_of(stage, frame, shutter, path="/quad"):
    """[(time code, points)] of the keys that the renderer makes, and its warnings."""
    options = Options(width=8, height=8, samples=1, camera="/camera", shutter=shutter)
    with Renderer(options) as renderer:
        renderer.load(stage, frame)
        text = renderer.session.dump()
        renderer.commit()
        warnings = list(renderer.log.warnings)
    about = text.split(f"mesh {path}\n")[1].split("\n\n")[0]
    keys = []
    for time, points in re.findall(r"points(?: at shutter (\S+))?: \d+: (.*)", about):
        numbers = np.array(points.replace("(", " ").replace(")", " ").split(), dtype=float)
        code = None if frame is None else frame + shutter[0] + float(time or 0) * np.ptp(shutter)
        keys.append((code, numbers.reshape(-1, 3)))
    assert keys
    return keys, warnings


def vectors(rng, count=4, scale=24.0):
    return Vt.Vec3fArray.FromNumpy((rng.random((count, 3)) * scale - scale / 2).astype(np.float32))


def stage_with(points, velocities, accelerations=None, per_second=24.0):
    """A quad with samples at the times given; None in their place is a default value."""
    stage = new_stage()
    stage.SetTimeCodesPerSecond(per_second)
    add_camera(stage)
    quad = add_quad(stage)
    rng = np.random.default_rng(11)
    rates = [(quad.CreateVelocitiesAttr(), velocities, 24.0)]
    rates += [(quad.CreateAccelerationsAttr(), accelerations, 500.0)] if accelerations else []
    for attribute, times, scale in [(quad.GetPointsAttr(), points, 2.0), *rates]:
        for time in times:
            attribute.Set(vectors(rng, 4, scale), Usd.TimeCode.Default() if time is None else time)
    return stage, quad


STAGES = {
    "one sample": ([0], [0], [0]),
    "no accelerations": ([0, 1, 3], [0, 1, 3], None),
    "aligned": ([0, 1, 3], [0, 1, 3], [0, 1, 3]),
    "other times": ([0, 1, 3], [0, 2, 3], None),
    "fewer velocities": ([0, 1, 3], [0, 1], None),
    "more velocities": ([0, 3], [0, 1, 3], None),
    "accelerations at other times": ([0, 1, 3], [0, 1, 3], [0, 3]),
    "fractions": ([0.1, 1.1, 2.9], [0.1, 1.1, 2.9], [0.1, 1.1, 2.9]),
    "default velocities": ([0, 3], [None], None),
    "default points": ([None], [0], [0]),
    "defaults beside samples": ([None, 0, 3], [None, 0, 3], [None, 0, 3]),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("held", [False, True], ids=["linear", "held"])
@pytest.mark.parametrize("name", STAGES)
def test_points_are_where_usd_says(name, held):
    stage, quad = stage_with(*STAGES[name])
    if held:
        stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    for frame in FRAMES:
        for shutter in SHUTTERS:
            if held and shutter != (0.0, 0.0):
                continue  # a held stage has no shutter
            keys, _ = points_of(stage, frame, shutter)
            for code, points in keys:
                wanted = np.array(quad.ComputePointsAtTime(code, frame))
                np.testing.assert_allclose(points, wanted, rtol=1e-4, atol=2e-4)


def test_at_the_default_time_nothing_moves():
    stage, quad = stage_with([None, 0, 3], [None, 0, 3])
    ((_, points),), warnings = points_of(stage, None, (0.0, 0.0))
    np.testing.assert_allclose(points, quad.GetPointsAttr().Get(), atol=1e-5)
    assert warnings == []


def test_seconds_are_the_stages():
    for per_second in (1.0, 24.0, 48.0):
        stage, quad = stage_with([0], [0], [0], per_second)
        keys, _ = points_of(stage, 0.5, (0.0, 0.5))
        for code, points in keys:
            wanted = np.array(quad.ComputePointsAtTime(code, 0.5))
            np.testing.assert_allclose(points, wanted, rtol=1e-4, atol=1e-4)


def moving_quad(velocity=(3.0, 1.0, 0.0), acceleration=None):
    """A quad that moves so far in a time code."""
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage, x0=-3, y0=-2, x1=0, y1=1)
    quad.GetPointsAttr().Set(quad.GetPointsAttr().Get(), 0)
    per_second = stage.GetTimeCodesPerSecond()
    quad.CreateVelocitiesAttr().Set([Gf.Vec3f(*velocity) * per_second] * 4, 0)
    if acceleration:
        quad.CreateAccelerationsAttr().Set([Gf.Vec3f(*acceleration) * per_second**2] * 4, 0)
    return stage, quad


STILL = quad_coverage(-3, -2, 0, 1)
MOVED = np.mean([quad_coverage(-3 + 3 * t, -2 + t, 3 * t, 1 + t) for t in np.arange(512) / 512], 0)


def wrong_lengths(stage, quad):
    quad.GetVelocitiesAttr().Set([Gf.Vec3f(1)] * 3, 0)


def wrong_times(stage, quad):
    quad.GetVelocitiesAttr().Set(quad.GetVelocitiesAttr().Get(0), 0.5)


def wrong_type(stage, quad):
    prim = stage.GetRootLayer().GetPrimAtPath("/quad")
    prim.RemoveProperty(prim.properties["velocities"])
    Sdf.AttributeSpec(prim, "velocities", Sdf.ValueTypeNames.String)
    stage.GetRootLayer().SetTimeSample("/quad.velocities", 0, "fast")


def no_seconds(stage, quad):
    stage.SetTimeCodesPerSecond(0.0)


def no_times(stage, quad):
    value = quad.GetVelocitiesAttr().Get(0)
    quad.GetVelocitiesAttr().Clear()
    quad.GetVelocitiesAttr().Set(value)


def not_finite(stage, quad):
    quad.GetVelocitiesAttr().Set([Gf.Vec3f(float("nan"), 0, 0)] * 4, 0)


def far_too_fast(stage, quad):
    quad.GetVelocitiesAttr().Set([Gf.Vec3f(0, 0, 3e38)] * 4, 0)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (wrong_lengths, "3 velocities for 4 values"),
        (wrong_times, "other sample times"),
        (wrong_type, "velocities has the type string, where vector3f[] is expected"),
        (no_seconds, "time codes a second"),
        (no_times, "no time samples"),
        (not_finite, "velocities or accelerations of 4 points are not finite"),
        (far_too_fast, "these points do not move"),
    ],
)
def test_velocities_that_cannot_be_used_are_named(change, words):
    stage, quad = moving_quad()
    np.testing.assert_allclose(render(stage, shutter=(0, 1), samples=64).alpha, MOVED, atol=0.06)
    change(stage, quad)
    image = render(stage, shutter=(0, 1))
    one_warning(image, "/quad", words)
    np.testing.assert_array_equal(image.alpha, STILL)


def test_a_bad_velocity_keeps_its_own_point_only():
    stage, quad = moving_quad((3, 0, 0))
    values = list(quad.GetVelocitiesAttr().Get(0))
    values[0] = values[3] = Gf.Vec3f(float("inf"), 0, 0)
    quad.GetVelocitiesAttr().Set(values, 0)
    image = render(stage, shutter=(1, 1), samples=16)
    one_warning(image, "/quad", "of 2 points")
    np.testing.assert_allclose(image.alpha, quad_coverage(-3, -2, 3, 1), atol=1e-6)


def test_accelerations_that_do_not_fit_leave_the_velocities():
    stage, quad = moving_quad(acceleration=(0, 9, 0))
    quad.GetAccelerationsAttr().Set([Gf.Vec3f(1)] * 5, 0)
    image = render(stage, shutter=(0, 1), samples=64)
    one_warning(image, "/quad", "5 accelerations for 4 values")
    np.testing.assert_allclose(image.alpha, MOVED, atol=0.06)


@pytest.mark.parametrize("acceleration", [1e4, 1e9, 1e12, 3e38])
def test_huge_accelerations_do_no_harm(acceleration):
    stage, _ = moving_quad((0, 0, 0), (0, acceleration / 24**2, 0))
    image = render(stage, shutter=(0, 1), samples=16)
    assert np.isfinite(image["color"]).all()
    assert image.alpha.sum() <= STILL.sum() + 1e-3
    assert len(image.warnings) <= 1


def test_a_fast_parabola_gets_the_keys_that_it_needs():
    for acceleration in (0.01, 4.0, 10.0, 1000.0):
        stage, _ = moving_quad((0, 0, 0), (0, acceleration, 0))
        options = Options(width=400, height=400, samples=1, camera="/camera", shutter=(0, 1))
        with Renderer(options) as renderer:
            renderer.load(stage, 0.0)
            renderer.commit()
            time = next(line for line in renderer.session.explain().splitlines() if "time:" in line)
        segments = int(re.search(r"(\d+) segments|linear", time).group(1) or 1)
        bend = acceleration / 8 * 40  # pixels
        needed = min(np.ceil(np.sqrt(bend / 0.1)), 32)
        # The sphere around the path comes nearer to the camera than the quad.
        assert needed <= segments <= max(needed * 1.5, 1), (acceleration, time)


def test_frames_move_on_from_their_own_sample():
    stage, quad = moving_quad((1, 0, 0))
    positions = {0: 0.0, 2: 4.0}
    quad.GetPointsAttr().Clear()
    quad.GetVelocitiesAttr().Clear()
    speed = Gf.Vec3f(24, 0, 0)
    for time, x in positions.items():
        corners = [(x - 3, -2, 0), (x, -2, 0), (x, 1, 0), (x - 3, 1, 0)]
        set_samples(quad.GetPointsAttr(), {time: Vt.Vec3fArray([Gf.Vec3f(*c) for c in corners])})
        set_samples(quad.GetVelocitiesAttr(), {time: Vt.Vec3fArray([speed] * 4)})
    options = Options(width=40, height=40, samples=4, camera="/camera", filter="box")
    with Renderer(options) as renderer:
        for frame, x in ((0.0, 0.0), (1.0, 1.0), (1.5, 1.5), (2.0, 4.0), (2.5, 4.5)):
            renderer.load(stage, frame)
            renderer.render()
            alpha = renderer.aov("color")[..., 3]
            np.testing.assert_allclose(alpha, quad_coverage(x - 3, -2, x, 1), atol=0.26)
        assert renderer.log.warnings == []


def particles(stage):
    points = UsdGeom.Points.Define(stage, "/it")
    points.CreateWidthsAttr([1.0, 0.5, 0.25, 1.5])
    return points


def hair(stage):
    curves = UsdGeom.BasisCurves.Define(stage, "/it")
    curves.CreateCurveVertexCountsAttr([4])
    curves.CreateWidthsAttr([0.5])
    curves.SetWidthsInterpolation("constant")
    return curves


def surface(stage):
    return add_mesh(stage, "/it", [], [4], [0, 1, 2, 3])


@pytest.mark.parametrize("scale", [1.0, 0.5])
@pytest.mark.parametrize("define", [particles, hair, surface])
def test_every_kind_of_points_moves(define, scale):
    """As points do that are authored where rates take them."""
    start = np.array(quad_points(-3, -2, 0, 1))
    speeds = np.array([(3, 1, 0), (1, 0, 0), (0, 1, 0), (3, -1, 0)])
    falls = np.array([(0, -2, 0), (0, 4, 0), (-4, 0, 0), (0, 0, 2)])
    stages = []
    for rated in (True, False):
        stage = new_stage()
        add_camera(stage)
        prim = define(stage)
        UsdGeom.MotionAPI.Apply(prim.GetPrim()).CreateMotionBlurScaleAttr(scale)
        times = [0.0] if rated else np.linspace(0, 1, 17)
        for time in times:
            points = start + speeds * time + 0.5 * falls * time**2
            value = Vt.Vec3fArray.FromNumpy(points.astype(np.float32))
            prim.GetPointsAttr().Set(value, time)
        if rated:
            for attribute, value in (
                (prim.CreateVelocitiesAttr(), 24 * speeds),
                (prim.CreateAccelerationsAttr(), 24**2 * falls),
            ):
                attribute.Set(Vt.Vec3fArray.FromNumpy(value.astype(np.float32)), 0)
        stages.append(stage)
        assert render(stage, shutter=(0, 1)).warnings == []
    one, other = (blurred(stage, samples=64, shutter=(0, 1)) for stage in stages)
    same, figures = agree(one, other)
    assert same, figures
    still = blurred(stages[0], samples=64, shutter=(0, 0))
    assert not agree(one, still)[0]
