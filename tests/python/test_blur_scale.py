"""UsdGeomMotionAPI: how much of a prim's motion is blurred, on every route to the renderer."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from oracle import agree, blurred
from pxr import Gf, Sdf, UsdGeom, Vt
from scenes import add_camera, add_quad, new_stage, one_warning, quad_coverage, render, set_samples
from skel_scenes import add_arm, bind
from test_motion import LEVELS, MOVE, moving_stage

MOVING = [level for level in LEVELS if level != "camera"]
SHUTTER = (-0.25, 0.5)


def scaled(stage, scale, path="/a"):
    """The stage, with a blur scale authored at a prim above the quad."""
    UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath(path)).CreateMotionBlurScaleAttr(scale)
    return stage


def coverage(frame, scale):
    """Of the moving quad: its path at times `scale` times as far from the frame."""
    times = SHUTTER[0] + (np.arange(512) + 0.5) / 512 * np.ptp(SHUTTER)
    steps = [np.array(MOVE) * (frame + scale * time) for time in times]
    return np.mean([quad_coverage(-3 + x, -2 + y, x, 1 + y) for x, y, _ in steps], axis=0)


def long_stage(level):
    """The moving quad, on its way for longer than any shutter here."""
    stage = moving_stage(level)
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            samples = attribute.GetTimeSamples()
            if len(samples) == 2:
                a, b = (np.array(attribute.Get(time)) for time in samples)
                for time, value in ((-4.0, a - 4 * (b - a)), (5.0, a + 5 * (b - a))):
                    flat = value.ndim == 1
                    value = Gf.Vec3d(*value) if flat else Vt.Vec3fArray.FromNumpy(value)
                    attribute.Set(value, time)
                for time in samples:
                    attribute.ClearAtTime(time)
    return stage


@pytest.mark.parametrize("level", MOVING)
@pytest.mark.parametrize("scale", [2.0, 0.5, 0.0])
def test_blur_is_scaled_about_the_frame(level, scale):
    stage = scaled(long_stage(level), scale)
    image = render(stage, frame=0.5, shutter=SHUTTER, samples=256)
    assert image.warnings == []
    expected = coverage(0.5, scale)
    np.testing.assert_allclose(image.alpha, expected, atol=0.04)
    assert abs(image.alpha.sum() - expected.sum()) < 0.003 * expected.sum()


def test_what_is_nearer_decides():
    stage = scaled(scaled(long_stage("own"), 0.0), 2.0, "/a/b")
    UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath("/a/b/quad"))  # says nothing itself
    alpha = render(stage, frame=0.5, shutter=SHUTTER, samples=64).alpha
    np.testing.assert_allclose(alpha, coverage(0.5, 2.0), atol=0.1)


def test_without_the_api_an_attribute_says_nothing():
    stage = scaled(long_stage("own"), 0.0)
    stage.GetPrimAtPath("/a").RemoveAPI(UsdGeom.MotionAPI)
    alpha = render(stage, frame=0.5, shutter=SHUTTER, samples=64).alpha
    np.testing.assert_allclose(alpha, coverage(0.5, 1.0), atol=0.1)


def test_the_scale_is_the_frames():
    stage = long_stage("points")
    api = UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath("/a"))
    set_samples(api.CreateMotionBlurScaleAttr(), {0: 0.0, 1: 2.0})
    for frame in (0.0, 0.5, 1.0):
        alpha = render(stage, frame=frame, shutter=SHUTTER, samples=64).alpha
        np.testing.assert_allclose(alpha, coverage(frame, 2.0 * frame), atol=0.1)


@pytest.mark.parametrize("scale", [-1.0, float("nan"), float("inf")])
def test_scales_that_are_none_are_named(scale):
    image = render(scaled(long_stage("own"), scale), frame=0.5, shutter=SHUTTER, samples=64)
    one_warning(image, "/a/b/quad", "motion blur scale", "taken as 1")
    np.testing.assert_allclose(image.alpha, coverage(0.5, 1.0), atol=0.1)


def test_a_number_of_samples_that_is_none_is_named():
    stage = long_stage("velocities")
    api = UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath("/a"))
    api.CreateNonlinearSampleCountAttr(0)
    image = render(stage, frame=0.5, shutter=SHUTTER)
    one_warning(image, "/a", "nonlinearSampleCount is 0")


def test_a_still_prim_costs_nothing():
    stage = scaled(long_stage("own"), 0.0)
    options = Options(width=8, height=8, samples=1, camera="/camera", shutter=SHUTTER)
    with Renderer(options) as renderer:
        renderer.load(stage, 0.5)
        renderer.commit()
        assert "time: still" in renderer.session.explain()


def falling_quad(stage, path):
    """A quad whose points fly and fall, and turn as a whole."""
    quad = add_quad(stage, path, x0=-1, y0=-1, x1=1, y1=0.5)
    per_second = stage.GetTimeCodesPerSecond()
    set_samples(quad.GetPointsAttr(), {-0.5: quad.GetPointsAttr().Get()})
    speeds = [Gf.Vec3f(x, y, 0.0) * per_second for x, y in ((1, 0), (0.5, 1), (-1, 1), (0, 0.5))]
    falls = [Gf.Vec3f(0, y, 0.0) * per_second**2 for y in (-4, -6, -4, -2)]
    quad.CreateVelocitiesAttr().Set(speeds, -0.5)
    quad.CreateAccelerationsAttr().Set(falls, -0.5)
    return quad


def routes(author):
    """The same scene with three native instances, and without instancing."""
    stages = []
    for instanced in (True, False):
        stage = new_stage()
        add_camera(stage)
        UsdGeom.Xform.Define(stage, "/source")
        author(stage, falling_quad(stage, "/source/quad"))
        stage.GetPrimAtPath("/source").SetSpecifier(Sdf.SpecifierClass)
        for i, (x, turn) in enumerate(((-2.5, 40.0), (0.0, 0.0), (2.5, -60.0))):
            copy = UsdGeom.Xform.Define(stage, f"/copies/copy{i}")
            copy.GetPrim().GetReferences().AddInternalReference("/source")
            copy.GetPrim().SetInstanceable(instanced)
            copy.AddTranslateOp().Set(Gf.Vec3d(x, 1, 0))
            set_samples(copy.AddRotateZOp().GetAttr(), {-2: 0.0, 2: turn})
        stages.append(stage)
    return stages


def plain(stage, quad):
    pass


def scale_of(scale):
    def author(stage, quad):
        UsdGeom.Xform.Define(stage, "/copies")
        UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath("/copies")).CreateMotionBlurScaleAttr(scale)

    return author


def inner_scale(stage, quad):
    UsdGeom.MotionAPI.Apply(quad.GetPrim()).CreateMotionBlurScaleAttr(1.5)


def two_samples(stage, quad):
    UsdGeom.MotionAPI.Apply(quad.GetPrim()).CreateNonlinearSampleCountAttr(2)


CHANGES = {
    "as it is": plain,
    "twice": scale_of(2.0),
    "half": scale_of(0.5),
    "none": scale_of(0.0),
    "inside": inner_scale,
    "two samples": two_samples,
}


@pytest.mark.parametrize("name", CHANGES)
def test_instances_blur_as_meshes_do(name):
    instanced, flat = routes(CHANGES[name])
    images = {}
    for which, stage in (("instanced", instanced), ("flat", flat)):
        assert render(stage, shutter=SHUTTER).warnings == []
        images[which] = blurred(stage, samples=64, shutter=SHUTTER)
    same, figures = agree(images["instanced"], images["flat"])
    assert same, figures
    if name != "as it is":
        other = blurred(routes(plain)[1], samples=64, shutter=SHUTTER)
        assert not agree(images["instanced"], other)[0], "the change does not show"


@pytest.mark.parametrize("rigid", [False, True], ids=["bends", "rigid"])
@pytest.mark.parametrize("scale", [2.0, 0.5, 0.0])
def test_what_a_skeleton_moves(scale, rigid):
    """A scaled blur is that of another shutter."""
    stages = []
    for factor in (scale, 1.0):
        stage = new_stage()
        add_camera(stage)
        mesh = add_arm(stage, angles={-2: (-40, -20), 0: (10, 0), 3: (70, 90)})
        if rigid:
            bind(mesh, [1], [1.0], 1, "/arm/skeleton", interpolation="constant")
        UsdGeom.MotionAPI.Apply(mesh.GetPrim()).CreateMotionBlurScaleAttr(factor)
        stages.append(stage)
    one = blurred(stages[0], samples=64, shutter=SHUTTER)
    other = blurred(stages[1], samples=64, shutter=tuple(scale * time for time in SHUTTER))
    same, figures = agree(one, other)
    assert same, figures
    assert not agree(one, blurred(stages[1], samples=64, shutter=SHUTTER))[0]
