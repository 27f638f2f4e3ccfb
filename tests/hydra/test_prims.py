"""Every kind of prim, sound and broken, through Hydra's hosts and through `hdtrapeze record`."""

import itertools

import instance_scenes
import pytest
import strands
from authored import export, same, vectors
from driver import record
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from scenes import add_grid, add_quad, quad_points, set_samples
from test_agreement import SCENES, assert_alike

# Curves and points --------------------------------------------------------------------------------


def wave(y):
    return [(x, y + dy, 0) for x, dy in zip((-4, -2, 0, 2, 4), (1, 2, 0, 2, 1), strict=True)]


def curves(stage):
    strands.add_curves(stage, "/linear", wave(2))
    strands.add_curves(stage, "/bspline", wave(0), basis="bspline", color=(1, 0, 0))
    varying = {"widths": [0.2, 0.5, 0.7], "interpolation": "varying"}
    strands.add_curves(stage, "/catmull", wave(-2), basis="catmullRom", **varying)
    strands.add_curves(stage, "/bezier", wave(-4)[:4], basis="bezier", color=(0, 0, 1))
    strands.add_curves(stage, "/pinned", wave(-5), basis="bspline", wrap="pinned", widths=0.3)
    ring = [(1, 0, 1), (0, 1, 1), (-1, 0, 1), (0, -1, 1)]
    strands.add_curves(stage, "/ring", ring, basis="bspline", wrap="periodic", widths=0.2)
    strands.add_curves(stage, "/no_widths", [(-3, 4.4, 0), (3, 4.4, 0)], widths=None, color=None)
    flat = strands.add_curves(stage, "/flat", [(-4, -4.5, 0), (4, -4.5, 0)], widths=0.8)
    kind = Sdf.ValueTypeNames.Token
    UsdGeom.PrimvarsAPI(flat).CreatePrimvar("trapeze:curves", kind, "constant").Set("ribbons")
    ribbon = strands.add_curves(stage, "/ribbon", [(3, -1, 0), (4, 0, 0), (3, 1, 0)], widths=0.4)
    strands.normals(ribbon, [(0, 1, 1)] * 3, "vertex")


def moving_curves(stage):
    moves = strands.add_curves(stage, "/moves", wave(0))
    set_samples(moves.GetPointsAttr(), {t: strands.vectors(wave(2 * t)) for t in (-1, 1)})
    set_samples(moves.GetWidthsAttr(), {t: strands.floats(0.9 + 0.6 * t) for t in (-1, 1)})


def points(stage):
    places = [(x, y, 0) for x in range(-3, 4) for y in range(-3, 4)]
    strands.add_points(stage, "/widths", places, widths=[0.2 + 0.02 * i for i in range(49)])
    strands.add_points(stage, "/no_widths", [(4.3, 0, 0)], widths=None)


def flying_points(stage):
    places = [(x, y, 0) for x in range(-3, 4) for y in range(-3, 4)]
    flies = strands.add_points(stage, "/flies", places, widths=0.4)
    flies.GetPointsAttr().Clear()
    for time in (0, 1):
        flies.GetPointsAttr().Set(vectors(places), time)
        flies.CreateVelocitiesAttr().Set(vectors([(7 * y, -7 * x, 0) for x, y, _ in places]), time)
        bends = vectors([(-300 * x, -300 * y, 0) for x, y, _ in places])
        flies.CreateAccelerationsAttr().Set(bends, time)


def test_bounds_that_stand_for_a_model(host):
    """Hosts draw them as lines of width 1 between eight points, with indices; and axes as well."""

    def bounds(stage, lo, hi):
        model = UsdGeom.Xform.Define(stage, "/model").GetPrim()
        Usd.ModelAPI(model).SetKind("component")
        api = UsdGeom.ModelAPI.Apply(model)
        api.CreateModelDrawModeAttr("bounds")
        api.CreateModelDrawModeColorAttr(Gf.Vec3f(1, 0, 0))
        api.SetExtentsHint(vectors([lo, hi]))
        add_quad(stage, "/model/quad", color=(0, 1, 0))

    def lines(stage, lo, hi):
        corners = list(itertools.product(*zip(lo, hi, strict=True)))
        edges = [0, 4, 4, 6, 6, 2, 2, 0, 1, 5, 5, 7, 7, 3, 3, 1, 0, 1, 4, 5, 6, 7, 2, 3]
        points = [corners[i] for i in edges]
        strands.add_curves(stage, "/edges", points, [2] * 12, color=(1, 0, 0), widths=1.0)

    box = (-3, -2, -1), (2, 3, 1)
    script = """
    stage = Usd.Stage.Open(scene)
    view = View(stage, "/camera", size=(96, 96), interactive=False, samples=4)
    for mode in ("bounds", "origin", "bounds"):
        edit(stage, "/model.model:drawMode", mode)
        view.render(0)
    view.save("view.exr")
    """
    ran = host.run(script, scene=export(host, lambda stage: bounds(stage, *box)))
    assert ran.warnings == []
    scene = export(host, lambda stage: lines(stage, *box))
    flags = ["-w", 96, "-f", 0, "--float", "--samples", 4]
    other = record(scene, host.folder / "record.exr", *flags, "-cam", "/camera")
    assert_alike(ran.image("view.exr"), other)


@pytest.mark.parametrize(("author", "opens", "closes"), [
    (curves, 0.0, 0.0),
    (moving_curves, -0.25, 0.25),
    (points, 0.0, 0.0),
    (flying_points, 0.0, 0.5),
    (flying_points, -0.1, 0.1),
])  # fmt: skip
def test_strands(host, author, opens, closes):
    same(host, author, opens, closes)


# Implicit surfaces and NURBS ----------------------------------------------------------------------


def implicit(stage):
    kinds = ["Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane", "Cylinder_1", "Capsule_1"]
    for i, kind in enumerate(kinds):
        prim = getattr(UsdGeom, kind).Define(stage, f"/{kind}")
        prim.AddTranslateOp().Set(Gf.Vec3d(i % 3 * 3 - 3, 3 - i // 3 * 3, 0))
        prim.AddRotateXYZOp().Set(Gf.Vec3f(30, 20, 10))
        prim.CreateDisplayColorAttr([Gf.Vec3f(1, i / 8, 0.5)])
    samples = {
        "/Sphere.radius": {-1: 0.2, 0: 1.0, 1: 1.8},
        "/Cylinder.height": {-1: 1.0, 1: 3.0},
        "/Cylinder_1.radiusTop": {-0.5: 0.2, 1: 1.2},
        "/Capsule_1.radiusBottom": {-1: 0.7, 1: 0.3},
        "/Plane.length": {-1: 0.2, 1: 2.8},
    }
    for path, values in samples.items():
        set_samples(stage.GetAttributeAtPath(path), values)
    UsdGeom.Cylinder.Get(stage, "/Cylinder").CreateAxisAttr("X")


def nurbs(stage):
    patch = UsdGeom.NurbsPatch.Define(stage, "/patch")
    values = {
        "uOrder": 4, "vOrder": 3, "uVertexCount": 5, "vVertexCount": 4,
        "uKnots": [0, 0, 0, 0, 1, 2, 2, 2, 2], "vKnots": [0, 0, 0, 1, 2, 2, 2],
        "pointWeights": [1.0 + i % 3 for i in range(20)],
        "points": vectors([(u * 2 - 4, v * 2 - 3, u * v % 3) for v in range(4) for u in range(5)]),
    }  # fmt: skip
    for name, value in values.items():
        patch.GetPrim().GetAttribute(name).Set(value)
    line = UsdGeom.NurbsCurves.Define(stage, "/line")
    values = {
        "curveVertexCounts": [5], "order": [4], "knots": [0, 0, 0, 0, 1, 2, 2, 2, 2],
        "points": vectors([(x * 2 - 4, 4 + x % 2, 1) for x in range(5)]), "widths": [0.3],
    }  # fmt: skip
    for name, value in values.items():
        line.GetPrim().GetAttribute(name).Set(value)
    line.SetWidthsInterpolation("constant")


@pytest.mark.parametrize("author", [implicit, nurbs])
def test_shapes_of_their_own(index_host, author):
    """Scene delegates make meshes of these."""
    same(index_host, author, -0.25, 0.25)


def test_what_is_not_supported(host):
    def author(stage):
        stage.DefinePrim("/smoke", "Volume")
        add_quad(stage)

    text = "prims of type volume are not supported; it is left out"
    same(host, author, warned=[("/smoke", text)])


def test_what_comes_back_is_not_told_again(host):
    script = """
    stage = Usd.Stage.Open(scene)
    smoke = stage.DefinePrim("/smoke", "Volume")
    view = View(stage, "/cam", samples=1)
    for active in (True, False, True):
        smoke.SetActive(active)
        view.render()
    """
    ran = host.run(script, scene=SCENES / "parts.usda")
    text = "prims of type volume are not supported; it is left out"
    assert ran.warnings == [("/smoke", text)]


# Surfaces and bad input ---------------------------------------------------------------------------


def surfaces(stage):
    kind = Sdf.ValueTypeNames.Color3fArray
    counts = {"constant": 1, "uniform": 4, "varying": 9, "vertex": 9, "faceVarying": 16}
    for i, (interpolation, count) in enumerate(counts.items()):
        scheme = "catmullClark" if i % 2 else "none"
        grid = add_grid(stage, f"/{interpolation}", 2, 0.8, scheme)
        UsdGeom.Xformable(grid).AddTranslateOp().Set((i % 3 * 2.5 - 2.5, 3 - 2.5 * (i // 3), 0))
        color = UsdGeom.PrimvarsAPI(grid).CreatePrimvar("displayColor", kind, interpolation)
        color.Set(vectors([(j * 37 % 100 / 100, j * 53 % 100 / 100, 0.5) for j in range(count)]))
    clear = add_grid(stage, "/clear", 2, 0.8)
    UsdGeom.Xformable(clear).AddTranslateOp().Set((2.5, 0.5, 0))
    clear.CreateDisplayOpacityPrimvar("vertex").Set(Vt.FloatArray([i / 9 for i in range(9)]))
    for i, rule in enumerate(("none", "edgeOnly", "edgeAndCorner")):
        grid = add_grid(stage, f"/{rule}", 3, 1.2, "catmullClark")
        grid.CreateInterpolateBoundaryAttr(rule)
        grid.CreateHoleIndicesAttr([4])
        grid.CreateOrientationAttr("leftHanded" if i else "rightHanded")
        UsdGeom.Xformable(grid).AddTranslateOp().Set((3 * i - 3, -3, 0))


def test_surfaces(host):
    same(host, surfaces)


BAD = [
    ("/empty", "1 faces but no points; dropped (topology)"),
    ("/few", "1 of 1 faces refer to points that do not exist (4 points); dropped (topology)"),
    ("/colors", "primvar displayColor has 3 values where its mesh has 4 face-vertices; it is "
     "ignored (primvar-length)"),
    ("/loop", "loop needs triangles, face 0 has 4 sides; rendered as polygons (topology)"),
    ("/curves", "curveVertexCounts sum to 5 but there are 3 points; 1 of 1 curves are dropped "
     "(topology)"),
    ("/spheres", "primvar widths has 3 values where its prim has 2 points; its first value, 0.3, "
     "is used all over (primvar-length)"),
    ("/rates", "3 velocities for 4 values; they are ignored (time-samples)"),
    ("/i", "1 orientations for 2 instances; they are ignored (topology)"),
]  # fmt: skip


def bad(stage):
    add_quad(stage, "/empty").GetPointsAttr().Set(vectors([]))
    add_quad(stage, "/few").GetFaceVertexIndicesAttr().Set([0, 1, 2, 9])
    add_quad(stage, "/no_points").GetPointsAttr().Clear()
    colors = UsdGeom.PrimvarsAPI(add_quad(stage, "/colors", -1, 2, 1, 4)).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, "faceVarying"
    )
    colors.Set(vectors([(1, 0, 0), (0, 1, 0), (0, 0, 1)]))
    add_quad(stage, "/loop", 2, -4, 4, -2).CreateSubdivisionSchemeAttr("loop")
    strands.add_curves(stage, "/curves", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [5], "bezier")
    strands.add_points(stage, "/spheres", [(0, 0, 2), (1, 0, 2)], [0.3, 0.4, 0.5], "vertex")
    rates = add_quad(stage, "/rates", -4, -4, -2, -2)
    rates.GetPointsAttr().Clear()
    for time in (0, 1):
        rates.GetPointsAttr().Set(vectors(quad_points(-4, -4, -2, -2)), time)
        rates.CreateVelocitiesAttr().Set(vectors([(0, 24, 0)] * 3), time)
    instance_scenes.box(stage, "/i/a", 0.3)
    quats = Vt.QuathArray([instance_scenes.turn((0, 0, 1), 45)])
    instance_scenes.points(
        stage, "/i", ["/i/a"], [0, 0], [(-4, 0, 0), (-3, 0, 0)]
    ).GetPrim().GetAttribute("orientations").Set(quats)


def test_bad_input(host):
    warned = [*BAD, ("/no_points", BAD[0][1])]
    same(host, bad, -0.25, 0.25, warned=warned)
