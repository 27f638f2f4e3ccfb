"""Stages with every nesting of instances, each a few lines; see test_nesting.py."""

import numpy as np
from pxr import Gf, Sdf, UsdGeom, Vt
from scenes import add_camera, add_cube, add_quad, new_stage, set_samples

RED, GREEN, BLUE, GRAY = (1, 0.1, 0.1), (0.1, 1, 0.1), (0.2, 0.3, 1), (0.6, 0.6, 0.6)


def turn(axis, degrees):
    """A unit quaternion: real, then imaginary part."""
    q = Gf.Rotation(Gf.Vec3d(*axis), degrees).GetQuat()
    return Gf.Quath(q.GetReal(), *q.GetImaginary())


def box(stage, path, half=0.4, color=None):
    """A cube of polygons."""
    return add_cube(stage, path, half, "none", color)


def points(stage, path, targets, indices, positions, **arrays):
    """A point instancer; `arrays` by USD's names."""
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(t) for t in targets])
    instancer.CreateProtoIndicesAttr(indices)
    instancer.CreatePositionsAttr([Gf.Vec3f(*p) for p in positions])
    for name, values in arrays.items():
        instancer.GetPrim().GetAttribute(name).Set(values)
    return instancer


def place(prim, *translate, turn=0.0):
    """Gives a prim a translation and a turn about z."""
    xform = UsdGeom.Xformable(prim)
    xform.AddTranslateOp().Set(Gf.Vec3d(*translate))
    if turn:
        xform.AddRotateZOp().Set(turn)
    return prim


def copy(stage, path, source, *translate, turn=0.0, color=None):
    """A native instance of `source`."""
    xform = UsdGeom.Xform.Define(stage, path)
    place(xform, *translate, turn=turn)
    xform.GetPrim().GetReferences().AddInternalReference(source)
    xform.GetPrim().SetInstanceable(True)
    if color:
        api = UsdGeom.PrimvarsAPI(xform)
        api.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "constant").Set([color])
    return xform


def library(stage, name="/lib"):
    """A class with a prototype of two parts, one of which has an own color and transform."""
    stage.CreateClassPrim(name)
    box(stage, f"{name}/a", 0.35)
    place(UsdGeom.Xform.Define(stage, f"{name}/arm"), 0.0, 0.6, 0.0, turn=20)
    box(stage, f"{name}/arm/b", 0.2, GREEN)
    return name


def three(stage):
    """One prototype beside another; orientations, scales (one mirrors), ids, one invisible."""
    place(box(stage, "/i/a", color=RED), 0.2, 0, 0)
    UsdGeom.Xform.Define(stage, "/i/b")
    place(box(stage, "/i/b/deep", 0.3, BLUE), 0, 0.3, 0, turn=30)
    instancer = points(
        stage,
        "/i",
        ["/i/a", "/i/b"],
        [0, 1, 0, 1, 0],
        [(-3, -2, 0), (-1, 2, 1), (1, -1, 0), (3, 2, -1), (0, 0, 2)],
        orientations=Vt.QuathArray([turn((1, 2, 3), 40.0 * i) for i in range(5)]),
        scales=[(1, 1, 1), (2, 1, 1), (-1, 1.5, 1), (1, -1, -1.2), (0.5, 0.5, 0.5)],
        ids=[10, 20, 30, 40, 50],
        invisibleIds=[30],
    )
    place(instancer, 0.3, 0.2, 0, turn=10)


def full_precision(stage):
    """orientationsf wins over orientations."""
    box(stage, "/i/a", color=RED)
    quats = [Gf.Quatf(turn((0, 1, 1), 33.0 * i)) for i in range(3)]
    arrays = {"orientationsf": Vt.QuatfArray(quats), "orientations": Vt.QuathArray(3)}
    points(stage, "/i", ["/i/a"], [0, 0, 0], [(-2, 0, 0), (0, 1, 0), (2, 0, 0)], **arrays)


def elsewhere(stage):
    """Prototypes beside the instancer, at the root, in a class, below an over."""
    UsdGeom.Xform.Define(stage, "/g")
    box(stage, "/g/sibling", 0.3, RED)
    place(box(stage, "/root", 0.3, GREEN), 0, -3, 0)
    library(stage, "/lib")
    box(stage, "/over/far", 0.3, BLUE)
    stage.GetPrimAtPath("/over").SetSpecifier(Sdf.SpecifierOver)
    targets = ["/g/sibling", "/root", "/lib", "/over"]
    points(stage, "/g/i", targets, [0, 1, 2, 3], [(-3, 1, 0), (-1, 1, 0), (1, 1, 0), (3, 1, 0)])


def points_in_points(stage):
    """An instancer as a prototype, and in one beside a mesh."""
    box(stage, "/in/a", 0.3, RED)
    place(points(stage, "/in", ["/in/a"], [0, 0], [(-0.6, 0, 0), (0.6, 0, 0)]), 0, 0.2, 0, turn=15)
    UsdGeom.Xform.Define(stage, "/out/p")
    box(stage, "/out/p/m", 0.2, BLUE)
    box(stage, "/out/p/i/q", 0.15, GREEN)
    deep = points(
        stage, "/out/p/i", ["/out/p/i/q"], [0, 0, 0], [(0, 0.5, 0), (0, 0.9, 0), (0, -1, 0)]
    )
    place(deep, 0.3, 0, 0)
    places = [(-3, 2, 0), (2, 2, 0), (-2, -2, 0), (3, -2, 0)]
    quats = Vt.QuathArray([turn((0, 0, 1), 25.0 * i) for i in range(4)])
    points(stage, "/out", ["/in", "/out/p"], [0, 1, 1, 0], places, orientations=quats)


def natives_in_points(stage):
    """A prototype that is a native instance, and one that holds several."""
    library(stage)
    copy(stage, "/i/one", "/lib", 0.1, 0, 0, turn=10, color=RED)
    UsdGeom.Xform.Define(stage, "/i/many")
    for i in range(3):
        copy(stage, f"/i/many/c{i}", "/lib", i - 1, 0, 0, turn=30.0 * i, color=BLUE)
    places = [(-3, 2, 0), (2, 2, 0), (0, -2, 0)]
    points(
        stage,
        "/i",
        ["/i/one", "/i/many"],
        [0, 1, 1],
        places,
        scales=[(1, 1, 1), (0.8,) * 3, (1.2,) * 3],
    )


def points_in_natives(stage):
    """A point instancer inside native instances, its prototypes inside and outside."""
    stage.CreateClassPrim("/lib")
    box(stage, "/far", 0.2, GREEN)
    box(stage, "/lib/i/a", 0.25)
    inner = points(
        stage, "/lib/i", ["/lib/i/a", "/far"], [0, 1, 0], [(0, 0, 0), (0.7, 0, 0), (0, 0.8, 0)]
    )
    place(inner, 0, -0.3, 0)
    for i, color in enumerate((RED, BLUE, RED)):
        copy(stage, f"/c{i}", "/lib", 3.0 * i - 3, 1, 0, turn=20.0 * i, color=color)


def natives_in_natives(stage):
    """Native instances in native instances, which inherit different colors at both levels."""
    library(stage, "/leaf")
    stage.CreateClassPrim("/tree")
    copy(stage, "/tree/l0", "/leaf", -0.7, 0, 0)
    copy(stage, "/tree/l1", "/leaf", 0.7, 0, 0, turn=40, color=BLUE)
    copy(stage, "/tree/l2", "/leaf", 0, 1.2, 0, turn=-30)
    for i, color in enumerate((None, RED, RED)):
        copy(stage, f"/t{i}", "/tree", 3.0 * i - 3, -0.5, 0, turn=10.0 * i, color=color)


def all_in_points(stage):
    """Points in natives in points."""
    points_in_natives(stage)
    UsdGeom.Xform.Define(stage, "/i/p")
    for i in range(2):
        copy(stage, f"/i/p/c{i}", "/lib", i - 0.5, 0.3, 0, color=GREEN if i else None)
    points(stage, "/i", ["/i/p"], [0, 0], [(-2, -3, 0), (2, -3, 1)])


def resets(stage):
    """Transforms that ignore their parents, in each kind of prototype."""
    UsdGeom.Xform.Define(stage, "/i/p")
    place(stage.GetPrimAtPath("/i/p"), 0, 5, 0)
    box(stage, "/i/p/free", 0.3, RED)
    UsdGeom.Xformable(place(stage.GetPrimAtPath("/i/p/free"), 0.5, 0, 0)).SetResetXformStack(True)
    place(points(stage, "/i", ["/i/p"], [0, 0], [(-2, -2, 0), (1, -2, 0)]), 0, 0, 0.5)
    stage.CreateClassPrim("/lib")
    box(stage, "/lib/bound", 0.3, GREEN)
    box(stage, "/lib/free", 0.3, BLUE)
    UsdGeom.Xformable(place(stage.GetPrimAtPath("/lib/free"), 0, 3, 0)).SetResetXformStack(True)
    for i in range(2):
        copy(stage, f"/c{i}", "/lib", 3 * i - 1, 1, 0)


def hidden(stage):
    """Visibility and purpose at each level."""
    UsdGeom.Xform.Define(stage, "/i/p")
    box(stage, "/i/p/shown", 0.3, GREEN)
    UsdGeom.Imageable(place(box(stage, "/i/p/not", 0.3, RED), 0.8, 0, 0)).MakeInvisible()
    UsdGeom.Imageable(place(box(stage, "/i/p/render", 0.3, RED), 0, 0.8, 0)).CreatePurposeAttr(
        "render"
    )
    UsdGeom.Imageable(place(box(stage, "/i/p/proxy", 0.2, BLUE), 0, -0.8, 0)).CreatePurposeAttr(
        "proxy"
    )
    points(stage, "/i", ["/i/p"], [0, 0, 0], [(-3, 2, 0), (0, 2, 0), (3, 2, 0)], invisibleIds=[1])
    library(stage)
    for i in range(4):
        copy(stage, f"/c{i}", "/lib", 2 * i - 3, -2, 0)
    UsdGeom.Imageable.Get(stage, "/c1").MakeInvisible()
    UsdGeom.Imageable.Get(stage, "/c2").CreatePurposeAttr("render")


def recursive(stage):
    """An instancer that reaches itself through another one; it is left out there."""
    box(stage, "/a/m", 0.3, RED)
    box(stage, "/b/m", 0.3, BLUE)
    points(stage, "/a", ["/a/m", "/b"], [0, 1], [(-2, 0, 0), (1, 1, 0)])
    points(stage, "/b", ["/b/m", "/a"], [0, 1], [(0, -1, 0), (1, 1, 0)])


NESTINGS = [
    three,
    full_precision,
    elsewhere,
    points_in_points,
    natives_in_points,
    points_in_natives,
    natives_in_natives,
    all_in_points,
    resets,
    hidden,
    recursive,
]


# Moving -------------------------------------------------------------------------------------------


def moving_points(stage):
    """Positions, orientations and scales with different samples, on a moving instancer."""
    box(stage, "/i/a", 0.6, RED)
    instancer = points(stage, "/i", ["/i/a"], [0, 0, 0], [(0, 0, 0)] * 3)
    start = np.array([(-3, -2, 0), (0, 1, 0), (2, -1, 1)], dtype=np.float32)
    positions = {0: start, 1: start + np.float32([(1, 1, 0), (0, 1, 1), (1, 0, 0)])}
    values = {time: Vt.Vec3fArray.FromNumpy(p) for time, p in positions.items()}
    set_samples(instancer.GetPositionsAttr(), values)
    quats = [Vt.QuathArray([turn((0, i, 1), a) for i in range(3)]) for a in (0, 90)]
    set_samples(instancer.CreateOrientationsAttr(), {-0.2: quats[0], 0.7: quats[1]})
    scales = [[(1, 1, 1)] * 3, [(0.5, 1, 1), (1, 1.5, 1), (1, 1, 1)]]
    set_samples(instancer.CreateScalesAttr(), {0.3: scales[0], 0.8: scales[1]})
    set_samples(instancer.AddRotateZOp().GetAttr(), {0: 0.0, 1: 40.0})


def rates(stage):
    """Velocities, accelerations and angular velocities from a sample before the frame."""
    box(stage, "/i/a", 0.6, BLUE)
    instancer = points(stage, "/i", ["/i/a"], [0, 0], [(0, 0, 0)] * 2)
    before = -0.25
    instancer.GetPositionsAttr().Set([(-2, -1, 0), (1, 1, 0)], before)
    instancer.CreateVelocitiesAttr().Set([(48, 0, 0), (0, -60, 24)], before)
    instancer.CreateAccelerationsAttr().Set([(0, 2000, 0), (1500, 0, 0)], before)
    instancer.CreateOrientationsAttr().Set([turn((1, 0, 0), 30), turn((0, 1, 0), 10)], before)
    instancer.CreateAngularVelocitiesAttr().Set([(0, 0, 24 * 120), (24 * 50, 0, 24 * 50)], before)
    instancer.CreateScalesAttr([(1, 1, 1), (1.5, 1, 1)])


def moving_nested(stage):
    """Moving natives in moving points in moving points."""
    stage.CreateClassPrim("/lib")
    box(stage, "/lib/a", 0.4, GREEN)
    set_samples(UsdGeom.Xformable.Get(stage, "/lib/a").AddRotateZOp().GetAttr(), {0: 0.0, 1: 60.0})
    UsdGeom.Xform.Define(stage, "/in/p")
    for i in range(2):
        xform = copy(stage, f"/in/p/c{i}", "/lib", i - 0.5, 0, 0)
        set_samples(xform.AddRotateZOp().GetAttr(), {0: 0.0, 1: 50.0 * i - 20})
    inner = points(stage, "/in", ["/in/p"], [0, 0], [(-1, 0, 0), (1, 0.5, 0)])
    set_samples(inner.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 1: Gf.Vec3d(0, 0.6, 0)})
    outer = points(stage, "/out", ["/in"], [0, 0], [(0, 0, 0)] * 2)
    places = {0: [(-2.4, 2, 0), (2.2, 1, 0)], 1: [(-2, 2.4, 0), (2.6, 1, 0.5)]}
    set_samples(outer.GetPositionsAttr(), places)
    quats = {0: [turn((0, 0, 1), 0)] * 2, 1: [turn((0, 0, 1), 45), turn((0, 0, 1), -30)]}
    set_samples(outer.CreateOrientationsAttr(), {t: Vt.QuathArray(q) for t, q in quats.items()})
    UsdGeom.Imageable(inner).CreateVisibilityAttr()


MOVING = [moving_points, rates, moving_nested]


def make(author):
    """A stage with the standard camera and what `author` adds."""
    stage = new_stage()
    stage.SetTimeCodesPerSecond(24)
    add_camera(stage)
    author(stage)
    add_quad(stage, "/back", -6, -6, 6, 6, z=-3, color=GRAY)
    return stage
