"""Attributes of another type than their schema's, and words that it does not know: one warning that
names prim, attribute, and both types or the known words. Types that lose nothing are taken.
"""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from hdtrapeze.cli import main
from pxr import Gf, Sdf, UsdGeom
from scenes import (
    add_camera,
    add_cube,
    add_quad,
    new_stage,
    one_warning,
    pixel,
    quad_coverage,
    quad_points,
    render,
)
from strands import add_curves

GOOD = (3.0, 3.0, 4.5, 4.5)
FOUR = [(-3, 0, 0), (-1, 0, 0), (1, 0, 0), (3, 0, 0)]
T = Sdf.ValueTypeNames


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, "/good", *GOOD)
    return stage


def retype(prim, name, kind, value, **info):
    """Authors an attribute with another type than its schema's."""
    prim = prim.GetPrim()
    spec = prim.GetStage().GetRootLayer().GetPrimAtPath(prim.GetPath())
    if name in spec.properties:
        spec.RemoveProperty(spec.properties[name])
    attribute = Sdf.AttributeSpec(spec, name, kind)
    attribute.default = value
    for key, one in info.items():
        attribute.SetInfo(key, one)


def add_patch(stage):
    patch = UsdGeom.NurbsPatch.Define(stage, "/bad")
    patch.CreatePointsAttr([(-2, -2, 0), (2, -2, 0), (-2, 2, 0), (2, 2, 0)])
    for create in (
        patch.CreateUVertexCountAttr,
        patch.CreateVVertexCountAttr,
        patch.CreateUOrderAttr,
        patch.CreateVOrderAttr,
    ):
        create(2)
    patch.CreateUKnotsAttr([0.0, 0.0, 1.0, 1.0])
    patch.CreateVKnotsAttr([0.0, 0.0, 1.0, 1.0])
    return patch


def add_nurbs_curve(stage):
    curve = UsdGeom.NurbsCurves.Define(stage, "/bad")
    curve.CreatePointsAttr(FOUR)
    curve.CreateCurveVertexCountsAttr([4])
    curve.CreateOrderAttr([2])
    curve.CreateKnotsAttr([0.0, 0.0, 1.0, 2.0, 3.0, 3.0])
    curve.CreateWidthsAttr([1.0])
    curve.SetWidthsInterpolation("constant")
    return curve


def add_instancer(stage):
    prototype = UsdGeom.Cube.Define(stage, "/bad/cube")
    instancer = UsdGeom.PointInstancer.Define(stage, "/bad")
    instancer.CreatePrototypesRel().SetTargets([prototype.GetPath()])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0), (-3, 0, 0)])
    return instancer


def add_points(stage):
    points = UsdGeom.Points.Define(stage, "/bad")
    points.CreatePointsAttr([(0, 0, 0)])
    points.CreateWidthsAttr([2.0])
    return points


MAKERS = {
    "mesh": lambda stage: add_quad(stage, "/bad"),
    "smooth": lambda stage: add_cube(stage, "/bad"),
    "cube": lambda stage: UsdGeom.Cube.Define(stage, "/bad"),
    "curves": lambda stage: add_curves(stage, "/bad", FOUR, [4], widths=1.0),
    "cubic": lambda stage: add_curves(stage, "/bad", FOUR, [4], "bezier", widths=1.0),
    "nurbs curves": add_nurbs_curve,
    "patch": add_patch,
    "points": add_points,
    "instancer": add_instancer,
}


@pytest.mark.parametrize(
    ("kind", "name", "found", "value", "expected", "shown"),
    [
        ("mesh", "points", T.Float2Array, [(0, 0)] * 4, "point3f[]", False),
        ("mesh", "faceVertexCounts", T.FloatArray, [4.0], "int[]", False),
        ("mesh", "faceVertexIndices", T.DoubleArray, [0, 1, 2, 3], "int[]", False),
        ("smooth", "holeIndices", T.FloatArray, [0.0], "int[]", True),
        ("smooth", "creaseSharpnesses", T.StringArray, ["x"], "float[]", True),
        ("smooth", "cornerIndices", T.Int, 1, "int[]", True),
        ("mesh", "doubleSided", T.Int, 1, "bool", True),
        ("mesh", "visibility", T.String, "invisible", "token", True),
        ("mesh", "purpose", T.String, "guide", "token", True),
        ("mesh", "orientation", T.Int, 1, "token", True),
        ("mesh", "velocities", T.String, "x", "vector3f[]", True),
        ("mesh", "velocities", T.Float3, (1, 2, 3), "vector3f[]", True),
        ("mesh", "primvars:displayColor", T.FloatArray, [1.0] * 12, "color3f[]", True),
        ("mesh", "primvars:displayColor", T.String, "red", "color3f[]", True),
        ("mesh", "primvars:displayOpacity", T.Color3fArray, [(0, 0, 0)], "float[]", True),
        ("mesh", "normals", T.FloatArray, [1.0], "normal3f[]", True),
        ("cube", "size", T.FloatArray, [1.0], "double", True),
        ("cube", "size", T.Bool, True, "double", True),
        ("curves", "points", T.StringArray, ["x"], "point3f[]", False),
        ("curves", "curveVertexCounts", T.FloatArray, [4.0], "int[]", False),
        ("curves", "widths", T.StringArray, ["x"], "float[]", True),
        ("curves", "type", T.String, "linear", "token", True),
        ("nurbs curves", "order", T.FloatArray, [2.0], "int[]", False),
        ("nurbs curves", "knots", T.StringArray, ["x"], "double[]", False),
        ("nurbs curves", "ranges", T.DoubleArray, [0.0, 3.0], "double2[]", True),
        ("nurbs curves", "pointWeights", T.StringArray, ["x"], "double[]", True),
        ("patch", "uOrder", T.Float, 2.0, "int", False),
        ("patch", "vKnots", T.StringArray, ["x"], "double[]", False),
        ("patch", "uRange", T.DoubleArray, [0, 1], "double2", True),
        ("points", "points", T.Int3, Gf.Vec3i(1, 2, 3), "point3f[]", False),
        ("points", "widths", T.String, "x", "float[]", True),
        ("instancer", "protoIndices", T.FloatArray, [0.0, 0.0], "int[]", False),
        ("instancer", "positions", T.FloatArray, [0.0] * 6, "point3f[]", False),
        ("instancer", "ids", T.StringArray, ["a", "b"], "int64[]", True),
        ("instancer", "invisibleIds", T.FloatArray, [0.0], "int64[]", True),
        ("instancer", "orientations", T.Float4Array, [(1, 0, 0, 0)] * 2, "quath[]", True),
        ("instancer", "orientationsf", T.StringArray, ["x"], "quatf[]", True),
        ("instancer", "scales", T.FloatArray, [1.0], "float3[]", True),
        ("instancer", "velocities", T.StringArray, ["x"], "vector3f[]", True),
        ("instancer", "angularVelocities", T.String, "x", "vector3f[]", True),
    ],
)
def test_another_type_is_told_and_not_used(stage, kind, name, found, value, expected, shown):
    prim = MAKERS[kind](stage).GetPrim()
    retype(prim, name, found, value)
    for shutter in (None, (0, 1)):
        image = render(stage, shutter=shutter)
        text = f"{name} has the type {found}, where {expected} is expected"
        one_warning(image, "/bad", text)
        assert (image.alpha[quad_coverage(*GOOD) == 1] == 1).all()
        assert image.alpha[pixel(0.1, 0.1)] == shown


def test_what_is_mistyped_is_as_if_it_were_not_there(stage):
    quad = add_quad(stage, "/bad")
    plain = render(stage)["color"]
    for name, kind, value in (
        ("orientation", T.String, "leftHanded"),
        ("visibility", T.String, "invisible"),
        ("faceVaryingLinearInterpolation", T.Int, 3),
        ("primvars:displayOpacity", T.StringArray, ["0"]),
    ):
        retype(quad, name, kind, value)
    image = render(stage)
    assert len(image.warnings) == 4, image.warnings
    np.testing.assert_array_equal(image["color"], plain)


def test_ids_that_are_none_leave_instances_to_their_numbers(stage):
    instancer = add_instancer(stage)
    instancer.CreateInvisibleIdsAttr([1])
    retype(instancer, "ids", T.StringArray, ["a", "b"])
    image = render(stage)
    one_warning(image, "/bad", "ids has the type string[]", "known by their numbers")
    assert image.alpha[pixel(0.1, 0.1)] == 1
    assert image.alpha[pixel(-2.9, 0.1)] == 0


@pytest.mark.parametrize(
    ("kind", "name", "found", "value"),
    [
        ("mesh", "points", T.Float3Array, quad_points(-2, -2, 2, 2)),
        ("mesh", "points", T.Double3Array, quad_points(-2, -2, 2, 2)),
        ("mesh", "points", T.Half3Array, quad_points(-2, -2, 2, 2)),
        ("mesh", "faceVertexCounts", T.Int64Array, [4]),
        ("mesh", "primvars:displayColor", T.Vector3dArray, [(1, 1, 1)]),
        ("mesh", "primvars:displayColor", T.Color3f, (1, 1, 1)),
        ("mesh", "primvars:displayOpacity", T.Double, 1.0),
        ("mesh", "primvars:displayOpacity", T.IntArray, [1]),
        ("cube", "size", T.Int, 2),
        ("cube", "size", T.Half, 2.0),
        ("curves", "widths", T.DoubleArray, [1.0]),
        ("instancer", "scales", T.Double3Array, [(1, 1, 1)] * 2),
        ("instancer", "orientations", T.QuatdArray, [Gf.Quatd(1)] * 2),
        ("instancer", "ids", T.IntArray, [7, 8]),
    ],
)
def test_types_that_lose_nothing_are_taken(stage, kind, name, found, value):
    prim = MAKERS[kind](stage).GetPrim()
    plain = render(stage)["color"]
    info = {"interpolation": "constant"} if "primvars" in name or name == "widths" else {}
    retype(prim, name, found, value, **info)
    image = render(stage)
    assert image.warnings == []
    np.testing.assert_array_equal(image["color"], plain)


def test_numbers_beyond_the_schemas_are_told(stage):
    retype(add_quad(stage, "/bad"), "faceVertexCounts", T.Int64Array, [1 << 32 | 4])
    image = render(stage)
    one_warning(image, "/bad", "faceVertexCounts has numbers that are too large for int[]")
    assert image.alpha[pixel(0.1, 0.1)] == 0


@pytest.mark.parametrize(
    ("kind", "name", "known"),
    [
        ("mesh", "visibility", "inherited, invisible; inherited"),
        ("mesh", "purpose", "default, render, proxy, guide; default"),
        ("mesh", "orientation", "rightHanded, leftHanded; rightHanded"),
        ("mesh", "subdivisionScheme", "catmullClark, loop, bilinear, none; catmullClark"),
        ("smooth", "interpolateBoundary", "none, edgeOnly, edgeAndCorner; edgeAndCorner"),
        ("smooth", "triangleSubdivisionRule", "catmullClark, smooth; catmullClark"),
        ("smooth", "faceVaryingLinearInterpolation", "boundaries, all; cornersPlus1"),
        ("cubic", "basis", "bezier, bspline, catmullRom; bezier"),
        ("cubic", "wrap", "nonperiodic, periodic, pinned; nonperiodic"),
        ("cubic", "type", "linear, cubic; cubic"),
    ],
)
def test_words_that_are_not_known_fall_back(stage, kind, name, known):
    prim = MAKERS[kind](stage).GetPrim()
    prim.GetAttribute(name).Set("weird")
    image = render(stage)
    one_warning(image, "/bad", f"{name} is 'weird', which is none of ", f"{known} is used")
    assert image.alpha[pixel(0.1, 0.1)] == 1


def test_an_interpolation_that_is_none_falls_back(stage):
    primvar = UsdGeom.PrimvarsAPI(add_quad(stage, "/bad")).GetPrimvar("displayColor")
    primvar.Set([Gf.Vec3f(1, 0, 0)])
    plain = render(stage)["color"]
    primvar.GetAttr().SetMetadata("interpolation", "weird")
    image = render(stage)
    known = "none of constant, uniform, varying, vertex, faceVarying; constant is used"
    one_warning(image, "/bad", f"displayColor has the interpolation 'weird', which is {known}")
    np.testing.assert_array_equal(image["color"], plain)


def test_a_string_of_a_purpose_leaves_what_is_inherited(stage):
    parent = UsdGeom.Xform.Define(stage, "/parent")
    parent.CreatePurposeAttr("guide")
    retype(add_quad(stage, "/parent/bad"), "purpose", T.String, "default")
    image = render(stage)
    one_warning(image, "/parent/bad", "purpose has the type string")
    assert image.alpha[pixel(0.1, 0.1)] == 0


def test_points_far_and_points_that_are_none_are_told_apart(stage):
    for name, value, words in (
        ("/far", 1e30, "beyond the largest coordinate, 1e12"),
        ("/none", float("nan"), "points that are not finite; dropped"),
    ):
        quad = add_quad(stage, name)
        points = quad.GetPointsAttr().Get()
        points[1] = Gf.Vec3f(value, 0, 0)
        quad.GetPointsAttr().Set(points)
        one_warning(render(stage), name, words)
        stage.RemovePrim(name)


def frame_bounds(stage):
    with Renderer(Options(width=16, height=16, samples=1)) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        assert renderer.aov("color").any()
        return renderer.log.warnings


@pytest.mark.parametrize("fault", ["counts", "types", "none"])
def test_usd_itself_says_nothing_where_bounds_are_framed(capfd, fault):
    stage = new_stage()
    add_quad(stage)
    instancer = add_instancer(stage)
    if fault == "counts":
        instancer.GetPositionsAttr().Set([(0, 0, 0)])
    elif fault == "types":
        retype(instancer, "positions", T.StringArray, ["x"])
        retype(add_quad(stage, "/quad2"), "points", T.StringArray, ["x"])
    else:
        instancer.GetPrim().RemoveProperty("positions")
    warnings = frame_bounds(stage)
    assert {path for path, _, _ in warnings} >= {"/bad"}
    assert len({path for path, _, _ in warnings}) == len(warnings), warnings
    out, err = capfd.readouterr()
    # Our own lines are there too where a test has run a command.
    assert not [line for line in (out + err).splitlines() if not line.startswith("warning: ")]


def test_a_command_says_it_once(tmp_path, capfd):
    stage = new_stage()
    add_quad(stage)
    add_instancer(stage).GetPositionsAttr().Set([(0, 0, 0)])
    retype(add_quad(stage, "/quad2"), "points", T.StringArray, ["x"])
    file = tmp_path / "bad.usda"
    stage.GetRootLayer().Export(str(file))
    flags = ["-w", "16", "--samples", "1"]
    assert main(["record", str(file), str(tmp_path / "out.png"), *flags]) == 0
    lines = [line for line in capfd.readouterr().err.splitlines() if "warning" in line.lower()]
    assert len(lines) == 2, lines
    assert all(any(path in line for line in lines) for path in ("/bad:", "/quad2:")), lines
