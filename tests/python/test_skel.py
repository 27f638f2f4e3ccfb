"""UsdSkel: known answers, UsdSkel's own baking as the oracle, blur, instances, bad input."""

import numpy as np
import pytest
from hdtrapeze.log import SceneLog
from hdtrapeze.shutter import Shutter
from hdtrapeze.skel import Skinning
from hdtrapeze.stage import Diagnostics
from hdtrapeze.transforms import TOLERANCE, TransformReader, compose
from oracle import agree, blurred, mean_over_times
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt
from scenes import add_camera, new_stage, one_warning, pixel, render, set_samples
from skel_scenes import (
    LENGTH,
    add_animation,
    add_arm,
    add_blend_shape,
    add_mesh,
    add_skeleton,
    animate,
    bind,
    shifted,
    strip,
    turn,
    use_blend_shapes,
    weigh,
)

BENT = {0: (0, 0), 1: (20, 60)}


class Read:
    """What the host makes of one skinned prim of a stage."""

    def __init__(self, stage, path, frame=0.0, shutter=(0.0, 1.0)):
        self.log = SceneLog()
        shutter = Shutter(frame, *shutter)
        transforms = TransformReader(shutter, self.log)
        skinning = Skinning(self.log)
        skinning.begin_frame(shutter, transforms)
        prim = stage.GetPrimAtPath(path)
        skinning.enter(prim, Usd.PrimDefaultPredicate)
        self.skinned = skinning.of(prim)
        self.skinned.place()
        self.points = self.skinned.points()
        self.levels = transforms.levels(prim)
        self._rest = np.array(UsdGeom.PointBased(prim).GetPointsAttr().Get(shutter.time))

    def world(self, time):
        """World points as the renderer moves them: keys joined by lines."""
        points = self._rest
        if self.points:
            times, arrays = self.points.times, self.points.arrays
            i = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
            points = arrays[i]
            if i + 1 < len(times) and time > times[i]:
                f = (time - times[i]) / (times[i + 1] - times[i])
                points = points * (1 - f) + arrays[i + 1] * f
        matrix = compose(self.levels, time)
        return points @ matrix[:3, :3] + matrix[3, :3]


def baked(stage, path, time):
    """World points of a prim as UsdSkel bakes them; `time` must be an authored one."""
    # Into another layer, as baking clears the samples that it reads.
    layer = Sdf.Layer.CreateAnonymous()
    flattened = stage.Flatten()
    layer.subLayerPaths.append(flattened.identifier)
    flat = Usd.Stage.Open(layer)
    assert UsdSkel.BakeSkinning(Usd.PrimRange(flat.GetPseudoRoot()))
    prim = flat.GetPrimAtPath(path)
    points = np.array(UsdGeom.PointBased(prim).GetPointsAttr().Get(time), dtype=np.float64)
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time))
    return points @ matrix[:3, :3] + matrix[3, :3]


# Known answers -----------------------------------------------------------------------------------


def test_a_bent_arm():
    stage = new_stage()
    add_arm(stage, angles={None: (0, 90)})
    read = Read(stage, "/arm/strip", frame=None)
    points, _, _ = strip()
    # The hand turns about the elbow by 90 degrees; what belongs to the upper arm stays.
    upper, hand = points[:, 0] < 1.5, points[:, 0] > 2.5
    np.testing.assert_allclose(read.world(0)[upper], points[upper], atol=1e-6)
    x, y = points[hand, 0] - LENGTH, points[hand, 1]
    expected = np.stack([LENGTH - y, x, 0 * x], axis=1)
    np.testing.assert_allclose(read.world(0)[hand], expected, atol=1e-6)
    assert len(read.points.times) == 1


def test_a_turning_joint_keeps_its_points_on_circles():
    stage = new_stage()
    add_arm(stage, angles={0: (0, 0), 1: (80, 0)})
    read = Read(stage, "/arm/strip")
    assert 8 < len(read.points.times) < 64
    points, _, _ = strip()
    radius, start = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])

    def miss(time, found):
        angle = start + np.radians(80 * time)
        exact = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
        return np.abs(found - exact).max()

    for time, array in zip(read.points.times, read.points.arrays, strict=True):
        assert miss(time, array) < 1e-5
    size = max(np.ptp(np.concatenate(read.points.arrays), axis=0))
    worst = max(miss(t, read.world(t)) for t in np.linspace(0, 1, 101))
    # Chords lie inside of the circle, so their middles miss it by most.
    assert 0.1 * TOLERANCE * size < worst < TOLERANCE * size * 1.01


def test_what_does_not_move_has_one_key():
    stage = new_stage()
    add_arm(stage, angles={0: (0, 90), 1: (0, 90), 2: (0, 0)})
    read = Read(stage, "/arm/strip")
    assert read.points.times == [0.0]
    assert read.points.varies


def blend_stage(weights, between=None):
    """A strip whose hand rises by (0, 1, 0) at weight 1, and by `between` at weight 0.5."""
    stage = new_stage()
    add_arm(stage, angles={None: (0, 0)})
    mesh = UsdGeom.Mesh.Get(stage, "/arm/strip")
    last = [16, 17]
    shape = add_blend_shape(stage, "/arm/strip/raise", [(0, 1, 0)] * 2, last)
    if between is not None:
        shape.CreateInbetween("half").SetWeight(0.5)
        shape.GetInbetween("half").SetOffsets(Vt.Vec3fArray([Gf.Vec3f(*between)] * 2))
    use_blend_shapes(mesh, ["raise"], ["/arm/strip/raise"])
    weigh(UsdSkel.Animation.Get(stage, "/arm/animation"), ["raise"], weights)
    return stage


def test_a_blend_shape_moves_on_a_line():
    read = Read(blend_stage({0: [0.0], 1: [0.8]}), "/arm/strip")
    assert read.points.times == [0.0, 1.0]
    points, _, _ = strip()
    for time in (0.0, 0.3, 1.0):
        expected = points.copy()
        expected[-2:, 1] += 0.8 * time
        np.testing.assert_allclose(read.world(time), expected, atol=1e-6)


def test_an_inbetween_shape_bends_the_path():
    read = Read(blend_stage({0: [0.0], 1: [1.0]}, between=(1, 0, 0)), "/arm/strip")
    points, _, _ = strip()
    for time, offset in ((0.0, (0, 0)), (0.25, (0.5, 0)), (0.5, (1, 0)), (0.75, (0.5, 0.5))):
        expected = points.copy()
        expected[-2:, :2] += offset
        np.testing.assert_allclose(read.world(time), expected, atol=2e-3)


def test_keys_follow_what_happens_within_the_shutter():
    stage = new_stage()
    add_arm(stage, angles={0: (0, 0), 0.3: (0, 30), 1: (0, 0)})
    read = Read(stage, "/arm/strip")
    assert 0.3 in read.points.times
    points, _, _ = strip()
    np.testing.assert_allclose(read.world(1.0), points, atol=1e-6)
    assert read.world(0.3)[-1, 1] > 0.9


def test_velocities_of_the_rest_shape_do_not_move_what_is_skinned():
    stage = new_stage()
    add_camera(stage)
    mesh = add_arm(stage, angles={0: (0, 90)}, half=0.4)
    still = render(stage, shutter=(0, 1)).alpha
    mesh.CreateVelocitiesAttr(Vt.Vec3fArray([Gf.Vec3f(50, 0, 0)] * 18))
    np.testing.assert_array_equal(render(stage, shutter=(0, 1)).alpha, still)


def test_keys_follow_the_shape_that_is_skinned():
    stage = new_stage()
    mesh = add_arm(stage, angles={0: (0, 90)})
    points = np.array(mesh.GetPointsAttr().Get())
    for time, rise in ((0, 0.0), (0.3, 1.0), (1, 0.0)):
        moved = (points + np.array([0, 0, rise])).astype(np.float32)
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(moved), time)
    read = Read(stage, "/arm/strip")
    assert read.points.times == [0.0, 0.3, 1.0]
    np.testing.assert_allclose(read.world(0.3)[:, 2], 1.0, atol=1e-6)


# The oracle --------------------------------------------------------------------------------------


def plain(stage):
    add_arm(stage, angles=BENT)


def dual_quaternion(stage):
    add_arm(stage, angles={0: (0, 0), 1: (20, 120)}, method="dualQuaternion")


def bind_transform(stage):
    add_arm(stage, angles=BENT, geom_bind=shifted(0.5, 0.25, 1) * Gf.Matrix4d().SetScale(1.5))


def joint_subset(stage):
    mesh = add_arm(stage, angles=BENT, joint_names=["upper/lower", "upper"])
    assert len(UsdSkel.BindingAPI(mesh).GetJointsAttr().Get()) == 2


def several_times(stage):
    add_arm(stage, angles={0: (0, 0), 0.25: (10, 0), 0.6: (30, 80), 1: (0, 60)})


def everything_moves(stage):
    """The SkelRoot, the skeleton, and the mesh with its own parent, each in its own way."""
    mesh = add_arm(stage, angles=BENT)
    group = UsdGeom.Xform.Define(stage, "/arm/group")
    moved = UsdGeom.Mesh.Define(stage, "/arm/group/strip")
    Sdf.CopySpec(stage.GetRootLayer(), mesh.GetPath(), stage.GetRootLayer(), moved.GetPath())
    stage.RemovePrim(mesh.GetPath())
    root = UsdGeom.Xformable.Get(stage, "/arm")
    set_samples(root.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 1: Gf.Vec3d(1, 2, 3)})
    set_samples(root.AddScaleOp().GetAttr(), {0: Gf.Vec3f(1), 1: Gf.Vec3f(1, 2, 1)})
    skeleton = UsdGeom.Xformable.Get(stage, "/arm/skeleton")
    set_samples(skeleton.AddRotateYOp().GetAttr(), {0: 0.0, 1: 40.0})
    set_samples(group.AddRotateZOp().GetAttr(), {0: 0.0, 1: 70.0})
    op = UsdGeom.Xformable.Get(stage, "/arm/group/strip").AddTranslateOp()
    set_samples(op.GetAttr(), {0: Gf.Vec3d(1, 0, 0), 1: Gf.Vec3d(0, 1, 0)})


def reset_stack(stage):
    add_arm(stage, angles=BENT)
    root = UsdGeom.Xformable.Get(stage, "/arm")
    root.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    strip_xform = UsdGeom.Xformable.Get(stage, "/arm/strip")
    strip_xform.AddRotateZOp().Set(30.0)
    strip_xform.SetResetXformStack(True)


def rigid(stage):
    """The whole mesh goes with the lower joint, half with the upper one too."""
    mesh = add_arm(stage, angles=BENT, geom_bind=shifted(0.5, 0, 0))
    bind(mesh, [1, 0], [0.75, 0.25], 2, interpolation="constant")
    UsdGeom.Xformable(mesh).AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    root = UsdGeom.Xformable.Get(stage, "/arm")
    set_samples(root.AddRotateXOp().GetAttr(), {0: 0.0, 1: 50.0})
    skeleton = UsdGeom.Xformable.Get(stage, "/arm/skeleton")
    set_samples(skeleton.AddRotateYOp().GetAttr(), {0: 10.0, 1: 40.0})


def at_rest(stage):
    add_arm(stage)
    rest = Vt.Matrix4dArray([Gf.Matrix4d().SetRotate(turn(25)), shifted(2, 0.5, 0)])
    UsdSkel.Skeleton.Get(stage, "/arm/skeleton").GetRestTransformsAttr().Set(rest)


def part_of_the_joints(stage):
    add_arm(stage, angles=BENT)
    add_animation(stage, "/arm/animation", {0: (0,), 1: (70,)}, joints=("upper",))
    rest = Vt.Matrix4dArray([Gf.Matrix4d(1), shifted(2, 0.5, 0)])
    UsdSkel.Skeleton.Get(stage, "/arm/skeleton").GetRestTransformsAttr().Set(rest)


def blended(stage):
    mesh = add_arm(stage, angles=BENT)
    every = [(0, 0, 0.1 * i) for i in range(18)]
    add_blend_shape(stage, "/arm/strip/deep", every)
    add_blend_shape(stage, "/arm/strip/raise", [(0, 1, 0)] * 2, [16, 17])
    use_blend_shapes(mesh, ["raise", "deep"], ["/arm/strip/raise", "/arm/strip/deep"])
    names = ["other", "deep", "raise"]
    weights = {0: [1, 0, 0.5], 1: [0, 1.5, -0.25]}
    weigh(UsdSkel.Animation.Get(stage, "/arm/animation"), names, weights)


def moving_rest(stage):
    mesh = add_arm(stage, angles=BENT)
    points, _, _ = strip()
    attribute = mesh.GetPointsAttr()
    for time, scale in ((0, 1.0), (1, 1.5)):
        attribute.Set(Vt.Vec3fArray.FromNumpy((points * scale).astype(np.float32)), time)


def inherited_binding(stage):
    """Skeleton, weights and bind transform come from a parent."""
    UsdSkel.Root.Define(stage, "/arm")
    add_skeleton(stage, "/arm/skeleton")
    add_animation(stage, "/arm/animation", BENT)
    group = UsdGeom.Xform.Define(stage, "/arm/group")
    animate(UsdSkel.Skeleton.Get(stage, "/arm/skeleton"), "/arm/animation")
    bind(group, [1], [1], 1, "/arm/skeleton", "constant", geom_bind=shifted(0, 1, 0))
    add_mesh(stage, "/arm/strip", *strip())
    Sdf.CopySpec(stage.GetRootLayer(), "/arm/strip", stage.GetRootLayer(), "/arm/group/strip")
    stage.RemovePrim("/arm/strip")


SCENES = (
    plain,
    dual_quaternion,
    bind_transform,
    joint_subset,
    several_times,
    everything_moves,
    reset_stack,
    rigid,
    at_rest,
    part_of_the_joints,
    blended,
    moving_rest,
    inherited_binding,
)


@pytest.mark.parametrize("author", SCENES)
def test_points_are_those_that_usd_bakes(author):
    stage = new_stage()
    author(stage)
    path = next(str(prim.GetPath()) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    read = Read(stage, path)
    for time in (0.0, 1.0):
        expected = baked(stage, path, time)
        np.testing.assert_allclose(read.world(time), expected, atol=1e-5)
    assert read.log.warnings == []


def test_everything_moves_within_the_tolerance_between_samples():
    stage = new_stage()
    everything_moves(stage)
    path = "/arm/group/strip"
    read = Read(stage, path)
    scale = np.ptp(np.concatenate(read.points.arrays), axis=0).max() * 2
    for time in np.linspace(0.05, 0.95, 7):
        exact = Read(stage, path, frame=0.0, shutter=(time, time))
        assert np.abs(read.world(time) - exact.world(time)).max() < 3 * TOLERANCE * scale


# Normals -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying"])
def test_normals_turn_with_the_joints(interpolation):
    stage = new_stage()
    add_camera(stage)
    mesh = add_arm(stage, angles={0: (0, 0)}, half=0.75)
    animation = UsdSkel.Animation.Get(stage, "/arm/animation")
    about_x = Gf.Quatf(Gf.Rotation(Gf.Vec3d(1, 0, 0), 40).GetQuat())
    animation.GetRotationsAttr().Set(Vt.QuatfArray([turn(0), about_x]), 0)
    # The skeleton's space, in which normals turn, is turned back against that of the mesh.
    UsdGeom.Xformable(mesh).AddRotateXOp().Set(15.0)
    count = 18 if interpolation == "vertex" else 32
    mesh.CreateNormalsAttr(Vt.Vec3fArray([Gf.Vec3f(0, 0, 1)] * count))
    mesh.SetNormalsInterpolation(interpolation)
    image = render(stage, aovs=("color", "normal"))
    upper, hand = image["normal"][pixel(0.6, 0.1)], image["normal"][pixel(3.6, 0.1)]
    np.testing.assert_allclose(upper, (0, 0, 1), atol=1e-3)
    turned = (0, -np.sin(np.radians(40)), np.cos(np.radians(40)))
    np.testing.assert_allclose(hand, turned, atol=1e-3)
    assert image.warnings == []


def test_blend_shapes_turn_normals():
    stage = blend_stage({0: [1.0]})
    add_camera(stage)
    mesh = UsdGeom.Mesh.Get(stage, "/arm/strip")
    mesh.CreateNormalsAttr(Vt.Vec3fArray([Gf.Vec3f(0, 0, 1)] * 18))
    mesh.SetNormalsInterpolation("vertex")
    shape = UsdSkel.BlendShape.Get(stage, "/arm/strip/raise")
    shape.GetOffsetsAttr().Set(Vt.Vec3fArray(2))
    shape.CreateNormalOffsetsAttr(Vt.Vec3fArray([Gf.Vec3f(-1, 0, 0)] * 2))
    image = render(stage, aovs=("color", "normal"))
    np.testing.assert_allclose(image["normal"][pixel(0.6, 0.1)], (0, 0, 1), atol=1e-3)
    tip = image["normal"][pixel(3.97, 0.1)]
    # At x = 3.875, three quarters of the way along the last face.
    expected = np.array([-0.75 * np.sqrt(0.5), 0, 0.25 + 0.75 * np.sqrt(0.5)])
    np.testing.assert_allclose(tip, expected / np.linalg.norm(expected), atol=0.02)


# Pictures ----------------------------------------------------------------------------------------


def test_a_skinned_arm_blurs_as_the_mean_over_time():
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, angles=BENT, half=0.5)
    over_time = mean_over_times(stage)
    same, figures = agree(blurred(stage, shutter=(0, 1)), over_time)
    assert same, figures
    add_animation(stage, "/arm/animation", {0: (0, 0), 1: (20, 85)})
    same, figures = agree(blurred(stage, shutter=(0, 1)), over_time)
    assert not same, f"another angle went unseen: {figures}"


def test_blur_scale_is_a_scaled_shutter():
    def arm(scale, shutter):
        stage = new_stage()
        add_camera(stage)
        add_arm(stage, angles={-2: (-40, -120), 2: (40, 120)}, half=0.4)
        if scale is not None:
            api = UsdGeom.MotionAPI.Apply(stage.GetPrimAtPath("/arm"))
            api.CreateMotionBlurScaleAttr(scale)
        return render(stage, shutter=shutter, samples=16)["color"]

    np.testing.assert_array_equal(arm(0.5, (-0.5, 0.5)), arm(None, (-0.25, 0.25)))
    assert np.abs(arm(0.5, (-0.5, 0.5)) - arm(None, (-0.5, 0.5))).max() > 0.05


def test_a_rigid_cube_goes_with_its_joint():
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, angles={0: (0, 90)})
    stage.RemovePrim("/arm/strip")
    cube = UsdGeom.Cube.Define(stage, "/arm/cube")
    cube.CreateSizeAttr(1.0)
    cube.AddTranslateOp().Set(Gf.Vec3d(-4, -4, 0))
    bind(cube, [1], [1], 1, "/arm/skeleton", "constant", geom_bind=shifted(4, 0, 0))
    image = render(stage)
    assert image.alpha[pixel(2, 2)] == 1.0
    assert image.alpha[pixel(-4, -4)] == 0.0
    assert image.warnings == []


@pytest.mark.parametrize("schema", [UsdGeom.BasisCurves, UsdGeom.Points])
def test_curves_and_points_go_with_their_joints(schema):
    """In a straight line along the arm; the lower half of it turns up."""
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, angles={0: (0, 90)})
    stage.RemovePrim("/arm/strip")
    prim = schema.Define(stage, "/arm/hair")
    x = np.linspace(0.0, 2 * LENGTH, 33)
    points = np.stack([x, 0 * x, 0 * x], axis=1).astype(np.float32)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateWidthsAttr(Vt.FloatArray([0.8] * 33))
    prim.SetWidthsInterpolation("vertex")
    if schema is UsdGeom.BasisCurves:
        prim.CreateTypeAttr("linear")
        prim.CreateCurveVertexCountsAttr([33])
    joints = [int(v > LENGTH) for v in x]
    bind(prim, joints, [1] * 33, 1, "/arm/skeleton")
    image = render(stage)
    assert image.alpha[pixel(1.1, 0.1)] == 1.0
    assert image.alpha[pixel(2.1, 1.6)] == 1.0
    assert image.alpha[pixel(3.6, 0.1)] == 0.0
    assert image.warnings == []


def test_later_frames_and_edits_are_seen():
    from hdtrapeze import Renderer

    stage = new_stage()
    add_camera(stage)
    mesh = add_arm(stage, angles={0: (0, 0), 1: (0, 90)}, half=0.5)
    seen = []
    with Renderer(camera="/camera", width=40, samples=4, filter="box") as renderer:

        def look(frame):
            renderer.load(stage, frame)
            renderer.render()
            alpha = renderer.aov("color")[..., 3]
            seen.append((alpha[pixel(3.6, 0.1)], alpha[pixel(2.1, 1.6)]))

        look(0.0)
        look(1.0)
        look(0.0)
        add_animation(stage, "/arm/animation", {0: (0, 90)})
        look(0.0)
        UsdSkel.BindingAPI(mesh).GetSkeletonRel().SetTargets([])
        look(0.0)
    assert seen == [(1, 0), (0, 1), (1, 0), (0, 1), (1, 0)]


# Instances ---------------------------------------------------------------------------------------


def crowd(angles, instanceable=True):
    """Instances of one arm, each with an animation of its own, one above the other."""
    stage = new_stage()
    add_camera(stage)
    stage.CreateClassPrim("/prototype")
    add_arm(stage, "/prototype/arm", half=0.4)
    for i, lower in enumerate(angles):
        source = f"/animations/turn{lower}".replace("-", "_")
        add_animation(stage, source, {0: (0, 0), 1: (0, lower)})
        xform = UsdGeom.Xform.Define(stage, f"/copy{i}")
        xform.AddTranslateOp().Set(Gf.Vec3d(-4, 3 - 2.5 * i, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/prototype")
        xform.GetPrim().SetInstanceable(instanceable)
        animate(xform, source)
    return stage


def test_instances_with_their_own_animations():
    shared, flat = (render(crowd((90, -90, 90), i), frame=1.0) for i in (True, False))
    np.testing.assert_array_equal(shared["color"], flat["color"])
    assert shared.alpha[pixel(-2, 4.4)] == 1.0
    assert shared.alpha[pixel(-2, -0.9)] == 1.0
    assert shared.statistics["prims"] == 2  # the first and the last are one
    assert flat.statistics["prims"] == 3
    assert shared.warnings == flat.warnings == []


def test_instances_of_a_skel_root():
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, "/prototype", half=0.4)
    UsdGeom.Imageable.Get(stage, "/prototype").MakeInvisible()
    for i, lower in enumerate((90, -90)):
        add_animation(stage, f"/animations/a{i}", {0: (0, lower)})
        root = UsdSkel.Root.Define(stage, f"/copy{i}")
        root.GetPrim().GetReferences().AddInternalReference("/prototype")
        root.GetPrim().SetInstanceable(True)
        root.GetVisibilityAttr().Set("inherited")
        UsdGeom.Xformable(root).AddTranslateOp().Set(Gf.Vec3d(-4, 2 - 4 * i, 0))
        animate(root, f"/animations/a{i}")
    image = render(stage)
    assert image.alpha[pixel(-2, 3.6)] == 1.0
    assert image.alpha[pixel(-2, -3.6)] == 1.0


def test_instances_bound_to_a_skeleton_outside():
    """Each is at another place in the skeleton's space, so nothing can be shared."""
    stage = new_stage()
    add_camera(stage)
    UsdSkel.Root.Define(stage, "/arm")
    add_skeleton(stage, "/arm/skeleton")
    add_animation(stage, "/arm/animation", {0: (0, 90)})
    stage.CreateClassPrim("/prototype")
    mesh = add_mesh(stage, "/prototype/strip", *strip(half=0.4))
    points, _, _ = strip()
    bind(mesh, [1] * len(points), [1] * len(points), 1)
    for i, x in enumerate((0, 50)):
        xform = UsdGeom.Xform.Define(stage, f"/arm/copy{i}")
        xform.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/prototype")
        xform.GetPrim().SetInstanceable(True)
        api = UsdSkel.BindingAPI.Apply(xform.GetPrim())
        api.CreateSkeletonRel().SetTargets(["/arm/skeleton"])
    animate(UsdSkel.Skeleton.Get(stage, "/arm/skeleton"), "/arm/animation")
    image = render(stage)
    assert image.statistics["prims"] == 2
    assert image.alpha[pixel(2.1, 1.6)] == 1.0
    assert image.alpha[pixel(1.5, -3)] == 0.0


def test_point_instanced_arms():
    stage = new_stage()
    add_camera(stage)
    instancer = UsdGeom.PointInstancer.Define(stage, "/instancer")
    add_arm(stage, "/instancer/arm", angles=BENT, half=0.4)
    instancer.CreatePrototypesRel().SetTargets(["/instancer/arm"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([(-4, 2, 0), (-4, -3, 0)])
    image = render(stage, frame=1.0)
    single = new_stage()
    add_camera(single)
    for i, y in enumerate((2, -3)):
        add_arm(single, f"/arm{i}", angles=BENT, half=0.4)
        UsdGeom.Xformable.Get(single, f"/arm{i}").AddTranslateOp().Set(Gf.Vec3d(-4, y, 0))
    np.testing.assert_allclose(image["color"], render(single, frame=1.0)["color"], atol=1e-6)
    assert image.statistics["prims"] == 1
    assert image.warnings == []


def test_hidden_skeletons_and_unbound_prims():
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, angles={0: (0, 90)}, half=0.4)
    skeleton = UsdSkel.Skeleton.Get(stage, "/arm/skeleton")
    skeleton.MakeInvisible()
    skeleton.CreatePurposeAttr("guide")
    add_mesh(stage, "/arm/free", *strip())
    UsdGeom.Xformable.Get(stage, "/arm/free").AddTranslateOp().Set(Gf.Vec3d(0, -3, 0))
    image = render(stage)
    assert image.alpha[pixel(2.1, 1.6)] == 1.0
    assert image.alpha[pixel(3.6, -2.9)] == 1.0
    assert image.warnings == []


# Bad input ---------------------------------------------------------------------------------------


def influences(stage):
    return UsdSkel.BindingAPI.Get(stage, "/arm/strip")


def index_out_of_range(stage):
    joints = influences(stage).GetJointIndicesAttr()
    value = joints.Get()
    value[-1] = 7
    value[0] = -1
    joints.Set(value)
    return "/arm/strip", "2 of 36 influences name none of 2 joints"


def weight_not_finite(stage):
    weights = influences(stage).GetJointWeightsAttr()
    value = weights.Get()
    value[-1] = float("nan")
    weights.Set(value)
    return "/arm/strip", "1 of 36 influences"


def weights_of_another_length(stage):
    influences(stage).GetJointWeightsAttr().Set(Vt.FloatArray([1.0] * 35))
    return "/arm/strip", "36 jointIndices and 35 jointWeights"


def influences_of_another_length(stage):
    influences(stage).GetJointWeightsAttr().Set(Vt.FloatArray([1.0] * 34))
    influences(stage).GetJointIndicesAttr().Set(Vt.IntArray([1] * 34))
    return "/arm/strip", "where 36 are needed"


def element_size_zero(stage):
    for attribute in (
        influences(stage).GetJointIndicesAttr(),
        influences(stage).GetJointWeightsAttr(),
    ):
        attribute.SetMetadata("elementSize", 0)
    return "/arm/strip", "element sizes 0 and 0"


def element_sizes_differ(stage):
    influences(stage).GetJointIndicesAttr().SetMetadata("elementSize", 3)
    return "/arm/strip", "element sizes 3 and 2"


def another_interpolation(stage):
    influences(stage).GetJointIndicesAttr().SetMetadata("interpolation", "uniform")
    return "/arm/strip", "uniform and vertex"


def no_weights(stage):
    influences(stage).GetPrim().RemoveProperty("primvars:skel:jointWeights")
    return "/arm/strip", "jointIndices only"


def weights_do_not_sum_to_one(stage):
    influences(stage).GetJointWeightsAttr().Set(Vt.FloatArray([0.4] * 36))
    return "/arm/strip", "18 points do not add up to 1"


def missing_skeleton(stage):
    influences(stage).GetSkeletonRel().SetTargets(["/arm/nothing"])
    return "/arm/strip", "its skeleton /arm/nothing is none"


def no_skeleton(stage):
    influences(stage).GetSkeletonRel().ClearTargets(True)
    return "/arm/strip", "but no skeleton"


def no_skel_root(stage):
    stage.GetPrimAtPath("/arm").SetTypeName("Xform")
    return "/arm/strip", "below no SkelRoot"


def api_not_applied(stage):
    stage.GetPrimAtPath("/arm/strip").RemoveAPI(UsdSkel.BindingAPI)
    return "/arm/strip", "SkelBindingAPI is not applied"


def singular_bind_transform(stage):
    influences(stage).CreateGeomBindTransformAttr(Gf.Matrix4d(0.0))
    return "/arm/strip", "geomBindTransform cannot be inverted"


def unknown_method(stage):
    influences(stage).CreateSkinningMethodAttr("sticky")
    return "/arm/strip", "'sticky', which is none"


def unknown_joints(stage):
    influences(stage).CreateJointsAttr(["upper", "upper/claw"])
    return "/arm/strip", "skel:joints names upper/claw"


def misordered_joints(stage):
    UsdSkel.Skeleton.Get(stage, "/arm/skeleton").GetJointsAttr().Set(["a/b", "a"])
    return "/arm/skeleton", "mis-ordered parent"


def no_joints(stage):
    skeleton = UsdSkel.Skeleton.Get(stage, "/arm/skeleton")
    for attribute in (
        skeleton.GetJointsAttr(),
        skeleton.GetBindTransformsAttr(),
        skeleton.GetRestTransformsAttr(),
    ):
        attribute.Block()
    UsdSkel.Animation.Get(stage, "/arm/animation").GetPrim().SetActive(False)
    stage.GetPrimAtPath("/arm").RemoveAPI(UsdSkel.BindingAPI)
    return "/arm/strip", "its skeleton /arm/skeleton has no joints"


def mistyped_bind_transforms(stage):
    spec = stage.GetRootLayer().GetPrimAtPath("/arm/skeleton")
    spec.RemoveProperty(spec.attributes["bindTransforms"])
    attribute = Sdf.AttributeSpec(spec, "bindTransforms", Sdf.ValueTypeNames.Float)
    attribute.default = 1.0
    return "/arm/skeleton", "bindTransforms has the type float, where matrix4d[]"


def bind_transforms_of_another_length(stage):
    attribute = UsdSkel.Skeleton.Get(stage, "/arm/skeleton").GetBindTransformsAttr()
    attribute.Set(Vt.Matrix4dArray(1))
    return "/arm/skeleton", "1 bindTransforms for 2 joints"


def singular_joint(stage):
    attribute = UsdSkel.Skeleton.Get(stage, "/arm/skeleton").GetBindTransformsAttr()
    attribute.Set(Vt.Matrix4dArray([Gf.Matrix4d(1), Gf.Matrix4d(0.0)]))
    return "/arm/skeleton", "bindTransforms of upper/lower cannot be inverted"


def neither_animation_nor_rest(stage):
    stage.GetPrimAtPath("/arm").RemoveAPI(UsdSkel.BindingAPI)
    stage.GetPrimAtPath("/arm/skeleton").RemoveProperty("restTransforms")
    return "/arm/skeleton", "no animation, and 0 restTransforms"


def animation_source_is_none(stage):
    animate(stage.GetPrimAtPath("/arm"), "/arm/strip")
    return "/arm/skeleton", "names /arm/strip, which is no SkelAnimation"


def animation_without_joints(stage):
    UsdSkel.Animation.Get(stage, "/arm/animation").GetJointsAttr().Set([])
    return "/arm/animation", "it has no joints"


def animation_of_other_joints(stage):
    UsdSkel.Animation.Get(stage, "/arm/animation").GetJointsAttr().Set(["leg", "leg/foot"])
    return "/arm/animation", "none of its joints (leg, leg/foot)"


def animation_arrays_do_not_fit(stage):
    UsdSkel.Animation.Get(stage, "/arm/animation").GetTranslationsAttr().Set(Vt.Vec3fArray(1))
    return "/arm/animation", "1 translations, 2 rotations, 2 scales for 2 joints"


def animation_not_finite(stage):
    attribute = UsdSkel.Animation.Get(stage, "/arm/animation").GetTranslationsAttr()
    attribute.Set(Vt.Vec3fArray([Gf.Vec3f(0), Gf.Vec3f(2, float("nan"), 0)]))
    return "/arm/animation", "the transform of upper/lower is not finite"


def wrong_type(stage):
    spec = stage.GetRootLayer().GetPrimAtPath("/arm/strip")
    name = "primvars:skel:jointIndices"
    spec.RemoveProperty(spec.attributes[name])
    attribute = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.StringArray)
    attribute.default = Vt.StringArray(["a"])
    attribute.SetInfo("interpolation", "vertex")
    attribute.SetInfo("elementSize", 2)
    return "/arm/strip", "primvars:skel:jointIndices has the type string[], where int[]"


def with_blend_shape(stage):
    mesh = UsdGeom.Mesh.Get(stage, "/arm/strip")
    shape = add_blend_shape(stage, "/arm/strip/raise", [(0, 1, 0)] * 2, [16, 17])
    use_blend_shapes(mesh, ["raise"], ["/arm/strip/raise"])
    weigh(UsdSkel.Animation.Get(stage, "/arm/animation"), ["raise"], {0: [0.5], 1: [1.0]})
    return shape


def point_indices_out_of_range(stage):
    with_blend_shape(stage).GetPointIndicesAttr().Set(Vt.IntArray([16, 18]))
    return "/arm/strip/raise", "1 of 2 pointIndices are none of 18 points"


def all_point_indices_out_of_range(stage):
    with_blend_shape(stage).GetPointIndicesAttr().Set(Vt.IntArray([-1, 18]))
    return "/arm/strip/raise", "2 of 2 pointIndices"


def offsets_of_another_length(stage):
    with_blend_shape(stage).GetOffsetsAttr().Set(Vt.Vec3fArray(3))
    return "/arm/strip/raise", "3 offsets for 2 points"


def offsets_not_finite(stage):
    value = Vt.Vec3fArray([Gf.Vec3f(0), Gf.Vec3f(float("inf"))])
    with_blend_shape(stage).GetOffsetsAttr().Set(value)
    return "/arm/strip/raise", "1 offsets are not finite"


def missing_blend_shape(stage):
    with_blend_shape(stage)
    mesh = UsdGeom.Mesh.Get(stage, "/arm/strip")
    use_blend_shapes(mesh, ["gone", "raise"], ["/arm/strip/gone", "/arm/strip/raise"])
    return "/arm/strip", "its blend shape /arm/strip/gone does not exist"


def fewer_targets_than_names(stage):
    with_blend_shape(stage)
    mesh = UsdGeom.Mesh.Get(stage, "/arm/strip")
    use_blend_shapes(mesh, ["raise", "more"], ["/arm/strip/raise"])
    return "/arm/strip", "2 skel:blendShapes for 1 blendShapeTargets"


def blend_weights_of_another_length(stage):
    with_blend_shape(stage)
    weigh(UsdSkel.Animation.Get(stage, "/arm/animation"), ["raise"], {0: [1, 2], 1: [1, 2]})
    return "/arm/animation", "2 blendShapeWeights for 1 blendShapes"


def blend_weight_not_finite(stage):
    with_blend_shape(stage)
    weigh(UsdSkel.Animation.Get(stage, "/arm/animation"), ["raise"], {0: [float("nan")], 1: [0]})
    return "/arm/animation", "weights of raise are not finite"


BAD = (
    index_out_of_range,
    weight_not_finite,
    weights_of_another_length,
    influences_of_another_length,
    element_size_zero,
    element_sizes_differ,
    another_interpolation,
    no_weights,
    weights_do_not_sum_to_one,
    missing_skeleton,
    no_skeleton,
    no_skel_root,
    api_not_applied,
    singular_bind_transform,
    unknown_method,
    unknown_joints,
    misordered_joints,
    no_joints,
    mistyped_bind_transforms,
    bind_transforms_of_another_length,
    singular_joint,
    neither_animation_nor_rest,
    animation_source_is_none,
    animation_without_joints,
    animation_of_other_joints,
    animation_arrays_do_not_fit,
    animation_not_finite,
    wrong_type,
    point_indices_out_of_range,
    all_point_indices_out_of_range,
    offsets_of_another_length,
    offsets_not_finite,
    missing_blend_shape,
    fewer_targets_than_names,
    blend_weights_of_another_length,
    blend_weight_not_finite,
)


@pytest.mark.parametrize("spoil", BAD)
def test_bad_input_gives_one_warning_and_a_picture(spoil):
    stage = new_stage()
    add_camera(stage)
    add_arm(stage, angles={0: (0, 0), 1: (0, 30)}, half=0.4)
    path, words = spoil(stage)
    log = SceneLog()
    diagnostics = Diagnostics(log)
    image = render(stage, shutter=(0, 0.5))
    one_warning(image, path, words)
    diagnostics.report()
    assert log.warnings == []  # USD's own words are not repeated
    assert np.isfinite(image["color"]).all()
    assert image.alpha[pixel(0.9, 0.1)] > 0.4  # the upper arm is where it was
