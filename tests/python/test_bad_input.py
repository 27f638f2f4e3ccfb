"""Bad input: one warning that names the prim, and the rest renders. Nothing crashes."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer, SceneError
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from scenes import (
    add_camera,
    add_cube,
    add_grid,
    add_mesh,
    add_quad,
    new_stage,
    one_warning,
    pixel,
    quad_coverage,
    quad_points,
    render,
    set_samples,
)

NAN, INF = float("nan"), float("inf")
GOOD = (3.0, 3.0, 4.5, 4.5)


@pytest.fixture
def stage():
    """A camera, and a good quad in a corner that must be there whatever else is not."""
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, "/good", *GOOD)
    return stage


def check(stage, *words, path="/bad", shown=None, **settings):
    image = render(stage, aovs=("color", "P", "primId"), **settings)
    one_warning(image, path, *words)
    good = quad_coverage(*GOOD) == 1
    assert (image.alpha[good] == 1).all()
    for values in image.values():
        assert np.isfinite(values).all()
    if shown is False:
        assert image.alpha[pixel(0.1, 0.1)] == 0
    elif shown:
        assert image.alpha[pixel(0.1, 0.1)] == 1
    return image


SCHEMES = pytest.mark.parametrize("scheme", ["none", "catmullClark"])


@SCHEMES
@pytest.mark.parametrize(
    ("counts", "indices"),
    [
        ([4, 4], [0, 1, 2, 3]),  # too few indices
        ([3], [0, 1, 2, 3]),  # too many
        ([-4], [0, 1, 2, 3]),
        ([4], []),
        ([4], [0, 1, 2, 7]),  # out of range
        ([4], [0, 1, 2, -1]),
        ([2147483647], [0, 1, 2, 3]),
    ],
)
def test_topology_that_contradicts_itself(stage, scheme, counts, indices):
    add_mesh(stage, "/bad", quad_points(-2, -2, 2, 2), counts, indices, scheme)
    check(stage)


@SCHEMES
def test_one_bad_face_does_not_hide_the_others_or_warns_for_all(stage, scheme):
    points = [*quad_points(-2, -2, 2, 2), (0, 0, 0)]
    add_mesh(stage, "/bad", points, [4, 2], [0, 1, 2, 3, 0, 1], scheme)
    check(stage)


@SCHEMES
def test_points_missing(stage, scheme):
    add_mesh(stage, "/bad", [], [4], [0, 1, 2, 3], scheme)
    check(stage, shown=False)


@SCHEMES
def test_a_mesh_with_nothing_is_silent(stage, scheme):
    add_mesh(stage, "/empty", [], [], [], scheme)
    UsdGeom.Mesh.Define(stage, "/unset")
    image = render(stage)
    assert image.warnings == []
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def test_meshes_with_attributes_of_another_type(stage):
    for name, kind, value in (
        ("points", Sdf.ValueTypeNames.IntArray, Vt.IntArray([1, 2, 3])),
        ("faceVertexIndices", Sdf.ValueTypeNames.StringArray, Vt.StringArray(["a"])),
        ("faceVertexCounts", Sdf.ValueTypeNames.Float3Array, Vt.Vec3fArray([(1, 2, 3)])),
    ):
        mesh = add_quad(stage, f"/bad_{name}")
        mesh.GetPrim().RemoveProperty(name)
        spec = stage.GetRootLayer().GetPrimAtPath(mesh.GetPath())
        Sdf.AttributeSpec(spec, name, kind).default = value
    image = render(stage)
    assert {w[0] for w in image.warnings} == {
        "/bad_points",
        "/bad_faceVertexIndices",
        "/bad_faceVertexCounts",
    }
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def retype(prim, name, kind=Sdf.ValueTypeNames.String, value="x"):
    """Authors an attribute with another type than its schema's."""
    spec = prim.GetStage().GetRootLayer().GetPrimAtPath(prim.GetPath())
    if name in spec.properties:
        spec.RemoveProperty(spec.properties[name])
    Sdf.AttributeSpec(spec, name, kind).default = value


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (UsdGeom.PointInstancer, "protoIndices"),
        (UsdGeom.Mesh, "points"),
    ],
)
def test_one_prim_with_an_attribute_of_another_type(stage, kind, name):
    prim = kind.Define(stage, "/bad").GetPrim()
    if kind is UsdGeom.PointInstancer:
        UsdGeom.PointInstancer(prim).CreatePositionsAttr([Gf.Vec3f(0)])
    retype(prim, name)
    check(stage, f"{name} has the type string, where", "is expected", shown=False)


@pytest.mark.parametrize(
    ("kind", "name", "fallback"),
    [
        (UsdGeom.Cube, "size", 2.0),
        (UsdGeom.Sphere, "radius", 1.0),
        (UsdGeom.Capsule_1, "radiusTop", 0.5),
        (UsdGeom.Plane, "width", 2.0),
        (UsdGeom.Plane, "length", 2.0),
    ],
)
def test_sizes_of_another_type_fall_back(stage, kind, name, fallback):
    prim = kind.Define(stage, "/bad").GetPrim()
    plain = render(stage)
    retype(prim, name, value="7")
    text = f"{name} has the type string, where double is expected; {fallback:g} is used"
    image = check(stage, text, shown=True)
    np.testing.assert_array_equal(image["color"], plain["color"])


@pytest.mark.parametrize("name", ["orientation", "axis"])
def test_tokens_of_an_implicit_prim_that_are_none_fall_back(stage, name):
    cylinder = UsdGeom.Cylinder.Define(stage, "/bad")
    cylinder.GetPrim().GetAttribute(name).Set("sideways")
    check(stage, f"{name} is 'sideways', which is none of", shown=True)


@pytest.mark.parametrize(
    ("kind", "sizes", "words", "shown"),
    [
        (UsdGeom.Sphere, {"radius": float("nan")}, "radius is NaN; the prim is dropped", False),
        (UsdGeom.Cone, {"height": float("inf")}, "height is inf; the prim is dropped", False),
        (UsdGeom.Cube, {"size": 1e30}, "the prim is dropped", False),
        (UsdGeom.Sphere, {"radius": -1.0}, "radius is -1; it is rendered", True),
        (UsdGeom.Plane, {"width": -1.0, "length": -2.0}, "width is -1; it is rendered", True),
    ],
)
def test_sizes_that_make_no_sense(stage, kind, sizes, words, shown):
    prim = kind.Define(stage, "/bad").GetPrim()
    for name, size in sizes.items():
        prim.GetAttribute(name).Set(size)
    check(stage, words, shown=shown)


def test_prims_without_size_are_silent(stage):
    for i, (kind, name) in enumerate(
        [
            (UsdGeom.Sphere, "radius"),
            (UsdGeom.Cube, "size"),
            (UsdGeom.Cylinder, "height"),
            (UsdGeom.Cylinder, "radius"),
            (UsdGeom.Cone, "height"),
            (UsdGeom.Cone, "radius"),
            (UsdGeom.Capsule, "height"),
            (UsdGeom.Capsule, "radius"),
            (UsdGeom.Plane, "width"),
        ]
    ):
        kind.Define(stage, f"/empty{i}").GetPrim().GetAttribute(name).Set(0.0)
    image = render(stage, aovs=("color", "P", "normal"))
    assert image.warnings == []
    assert all(np.isfinite(values).all() for values in image.values())


def test_a_primvar_of_many_values_on_an_implicit_prim_is_ignored(stage):
    sphere = UsdGeom.Sphere.Define(stage, "/bad")
    primvar = sphere.CreateDisplayColorPrimvar("vertex")
    primvar.Set([Gf.Vec3f(1, 0, 0)] * 4)
    image = check(stage, "displayColor has 4 values where its shape has 1 value (round", shown=True)
    red, green, _, _ = image["color"][pixel(0.1, 0.1)]
    assert red == green > 0
    primvar.Set([Gf.Vec3f(1, 0, 0)])
    image = render(stage)
    assert image.warnings == []
    red, green, _, _ = image["color"][pixel(0.1, 0.1)]
    assert red > 0 == green


def test_a_transform_op_of_another_type_is_no_transform(stage):
    parent = UsdGeom.Xform.Define(stage, "/bad")
    parent.AddTranslateOp().Set(Gf.Vec3d(1, 0, 0))
    retype(parent.GetPrim(), "xformOp:translate")
    add_quad(stage, "/bad/one")
    add_quad(stage, "/bad/two", -4, -4, -3, -3)
    text = "xformOp:translate has the type string, where double3 is expected"
    image = check(stage, text, "transform is taken as none", shown=True)
    expected = quad_coverage(-2, -2, 2, 2) + quad_coverage(*GOOD) + quad_coverage(-4, -4, -3, -3)
    np.testing.assert_array_equal(image.alpha, expected)


def test_a_fault_of_a_later_frame_takes_the_prim_away(stage):
    quad = add_quad(stage, "/bad")
    with Renderer(Options(width=40, height=40, samples=4, filter="box")) as renderer:
        renderer.load(stage, 0.0, UsdGeom.Camera.Get(stage, "/camera"))
        renderer.render()
        assert renderer.aov("color")[20, 20, 3] == 1
        retype(quad.GetPrim(), "points")
        renderer.load(stage, 1.0, UsdGeom.Camera.Get(stage, "/camera"))
        renderer.render()
        np.testing.assert_array_equal(renderer.aov("color")[..., 3], quad_coverage(*GOOD))
        assert [w[0] for w in renderer.log.warnings] == ["/bad"]


@pytest.mark.parametrize(
    ("name", "fallback"),
    [
        ("focalLength", "50"),
        ("horizontalAperture", "20.955"),
        ("focusDistance", "0"),
        ("fStop", "0"),
        ("shutter:open", "0"),
        ("shutter:close", "0"),
        ("clippingRange", "(1, 1000000)"),
        ("projection", "perspective"),
    ],
)
def test_camera_attributes_of_another_type_fall_back(stage, name, fallback):
    retype(stage.GetPrimAtPath("/camera"), name)
    add_quad(stage)
    image = render(stage)
    one_warning(image, "/camera", f"{name} has the type string", f"{fallback} is used")
    assert image.alpha.any()


def test_three_bad_primvars_are_three_warnings(stage):
    mesh = add_quad(stage, "/bad")
    for name, kind in (
        ("displayColor", Sdf.ValueTypeNames.Color3fArray),
        ("displayOpacity", Sdf.ValueTypeNames.FloatArray),
        ("normals", Sdf.ValueTypeNames.Normal3fArray),
    ):
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, kind, "vertex")
        primvar.Set([1.0] * 3 if name == "displayOpacity" else [Gf.Vec3f(1)] * 3)
    image = render(stage)
    assert len(image.warnings) == 3, image.warnings
    for name in ("displayColor", "displayOpacity", "normals"):
        assert sum(name in text for _, _, text in image.warnings) == 1


@SCHEMES
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_points_that_are_not_finite(stage, scheme, value):
    points = quad_points(-2, -2, 2, 2)
    points[2] = (2, value, 0)
    add_mesh(stage, "/bad", points, [4], [0, 1, 2, 3], scheme)
    check(stage)


def test_points_that_are_absurdly_far(stage):
    points = quad_points(-2, -2, 2, 2)
    points[2] = (3e38, 3e38, 0)
    add_mesh(stage, "/bad", points, [4], [0, 1, 2, 3])
    image = check(stage, "points that are beyond the largest coordinate, 1e12", shown=False)
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


@SCHEMES
def test_zero_size_faces_are_harmless(stage, scheme):
    add_mesh(stage, "/point", [(0, 0, 0)] * 4, [4], [0, 1, 2, 3], scheme)
    add_mesh(stage, "/line", [(-1, 0, 0), (0, 0, 0), (1, 0, 0)], [3], [0, 1, 2], scheme)
    image = render(stage)
    assert (image.alpha[quad_coverage(*GOOD) == 1] == 1).all()
    assert np.isfinite(image["color"]).all()
    assert image.warnings == []


def test_a_face_that_uses_a_point_twice(stage):
    add_mesh(stage, "/odd", quad_points(-2, -2, 2, 2), [5], [0, 1, 1, 2, 3], "catmullClark")
    image = render(stage)
    assert (image.alpha[quad_coverage(*GOOD) == 1] == 1).all()
    assert image.warnings == []


def test_loop_on_quads(stage):
    add_cube(stage, "/bad", scheme="loop")
    check(stage)


def test_unknown_scheme(stage):
    mesh = add_quad(stage, "/bad")
    mesh.GetSubdivisionSchemeAttr().Set("wrong")
    check(stage, "subdivisionScheme", "wrong")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda mesh: mesh.CreateHoleIndicesAttr([99]),
        lambda mesh: mesh.CreateCornerIndicesAttr([0, 1]),
        lambda mesh: (
            mesh.CreateCornerIndicesAttr([77]),
            mesh.CreateCornerSharpnessesAttr([1.0]),
        ),
        lambda mesh: (
            mesh.CreateCreaseIndicesAttr([0, 1]),
            mesh.CreateCreaseLengthsAttr([5]),
            mesh.CreateCreaseSharpnessesAttr([1.0]),
        ),
        lambda mesh: (
            mesh.CreateCreaseIndicesAttr([0, 99]),
            mesh.CreateCreaseLengthsAttr([2]),
            mesh.CreateCreaseSharpnessesAttr([1.0]),
        ),
        lambda mesh: (
            mesh.CreateCornerIndicesAttr([0]),
            mesh.CreateCornerSharpnessesAttr([NAN]),
        ),
    ],
    ids=["hole", "corner count", "corner index", "crease length", "crease index", "sharpness"],
)
def test_bad_features_are_left_out(stage, spoil):
    spoil(add_grid(stage, "/bad", n=4, scheme="catmullClark"))
    check(stage, shown=True)


def test_face_varying_of_the_wrong_length(stage):
    mesh = add_grid(stage, "/bad", n=2, scheme="catmullClark")
    mesh.CreateDisplayColorPrimvar("faceVarying").Set([Gf.Vec3f(1, 0, 0)] * 15)
    check(stage, "displayColor", shown=True)


def test_empty_primvars_are_as_if_unset(stage):
    mesh = add_grid(stage, "/fine", n=2)
    mesh.CreateDisplayColorPrimvar("vertex").Set(Vt.Vec3fArray())
    mesh.CreateDisplayOpacityPrimvar("vertex").Set(Vt.FloatArray())
    assert render(stage).warnings == []


def test_colors_that_are_not_finite(stage):
    mesh = add_quad(stage, "/bad")
    mesh.CreateDisplayColorPrimvar("vertex").Set([Gf.Vec3f(NAN, 0, 0)] * 4)
    check(stage, "displayColor", shown=True)


@pytest.mark.parametrize(
    "matrix",
    [
        Gf.Matrix4d(*[NAN] * 16),
        Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(INF, 0, 0)),
    ],
)
def test_transforms_that_are_not_finite(stage, matrix):
    add_quad(stage, "/bad").AddTransformOp().Set(matrix)
    check(stage, shown=False)


@pytest.mark.parametrize(
    ("matrix", "warns"),
    [
        (Gf.Matrix4d(1).SetScale(0.0), False),
        (Gf.Matrix4d(1).SetScale(Gf.Vec3d(1, 0, 1)), False),
        (Gf.Matrix4d(1).SetScale(1e30), True),
        (Gf.Matrix4d(1).SetScale(1e-30), False),
        (Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(1e30, 0, 0)), True),
    ],
    ids=["zero", "flat", "huge", "tiny", "far"],
)
def test_absurd_transforms_do_no_harm(stage, matrix, warns):
    add_quad(stage, "/odd", -2, -2, 2, 2, z=-1).AddTransformOp().Set(matrix)
    image = render(stage)
    if warns:
        one_warning(image, "/odd", "its transform has numbers beyond 1e18")
    else:
        assert image.warnings == []
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def test_number_of_points_changes_within_the_shutter(stage):
    mesh = add_quad(stage, "/bad")
    points = mesh.GetPointsAttr().Get()
    mesh.GetPointsAttr().Set(points, 0)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray([*points, Gf.Vec3f(0)]), 1)
    check(stage, shutter=(0, 1), shown=True)


def test_varying_topology_is_fine(stage):
    mesh = add_quad(stage, "/varying")
    points, triangle = mesh.GetPointsAttr().Get(), [(-1, -1, 0), (1, -1, 0), (1, 1, 0)]
    set_samples(mesh.GetPointsAttr(), {0: points, 1: Vt.Vec3fArray(triangle)})
    set_samples(mesh.GetFaceVertexCountsAttr(), {0: [4], 1: [3]})
    set_samples(mesh.GetFaceVertexIndicesAttr(), {0: [0, 1, 2, 3], 1: [0, 1, 2]})
    for frame, area in ((0.0, 16.0), (0.5, 16.0), (1.0, 2.0)):
        image = render(stage, frame=frame, samples=64)
        assert image.warnings == []
        covered = image.alpha.sum() / 16 - 1.5 * 1.5
        assert covered == pytest.approx(area, rel=0.03), frame


def test_camera_that_shows_nothing_useful(stage):
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.GetClippingRangeAttr().Set(Gf.Vec2f(5, 1))
    one_warning(render(stage), "/camera", "clippingRange")


@pytest.mark.parametrize("name", ["horizontalAperture", "focalLength"])
@pytest.mark.parametrize("value", [0.0, NAN])
def test_camera_numbers_that_cannot_be(stage, name, value):
    stage.GetPrimAtPath("/camera").GetAttribute(name).Set(value)
    image = render(stage)
    one_warning(image, "/camera", "give no view; the default is used")
    assert np.isfinite(image["color"]).all()


def test_lens_without_focus_distance(stage):
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.GetFStopAttr().Set(2.0)
    camera.GetFocusDistanceAttr().Set(0.0)
    image = render(stage)
    assert [w[0] for w in image.warnings] == ["/camera"]
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "matrix",
    [
        Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(1e30, 0, 0)),
        Gf.Matrix4d(1).SetScale(1e200),
        Gf.Matrix4d(*[NAN] * 16),
    ],
    ids=["far", "huge", "nan"],
)
def test_framing_leaves_out_what_is_absurd(matrix):
    stage, plain = new_stage(), new_stage()
    for one in (stage, plain):
        UsdGeom.Xform.Define(one, "/world")
        add_quad(one, "/world/good")
    add_quad(stage, "/world/bad").AddTransformOp().Set(matrix)
    image = render(stage)
    one_warning(image, "/world/bad")
    np.testing.assert_array_equal(image["color"], render(plain)["color"])
    assert image.alpha.any()


def test_framing_leaves_out_what_cannot_be_read():
    stage = new_stage()
    add_quad(stage)
    bad = UsdGeom.Xform.Define(stage, "/bad")
    bad.AddTranslateOp().Set(Gf.Vec3d(0))
    retype(bad.GetPrim(), "xformOp:translate")
    add_quad(stage, "/bad/quad")
    image = render(stage)
    one_warning(image, "/bad", "transform")
    assert image.alpha.any()


def test_projections_that_are_none(stage):
    UsdGeom.Camera.Get(stage, "/camera").GetProjectionAttr().Set("fisheye")
    image = render(stage)
    one_warning(image, "/camera", "fisheye", "perspective is used")
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def test_clipping_behind_the_camera(stage):
    UsdGeom.Camera.Get(stage, "/camera").GetClippingRangeAttr().Set(Gf.Vec2f(-10, 100))
    one_warning(render(stage), "/camera", "clippingRange", "-10")


@pytest.mark.parametrize("plane", [(0, 0, 0, -1), (NAN, 0, 1, 0), (0, INF, 0, 1)])
def test_clipping_planes_that_are_none(stage, plane):
    planes = [Gf.Vec4f(*plane), Gf.Vec4f(0, 0, 0, 0)]
    UsdGeom.Camera.Get(stage, "/camera").CreateClippingPlanesAttr(planes)
    image = render(stage)
    one_warning(image, "/camera", "clipping plane", "ignored")
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


@pytest.mark.parametrize(
    ("name", "kind", "value", "words"),
    [
        ("trapeze:aperture:blades", "Int", -1, "blades"),
        ("trapeze:aperture:blades", "Double", 5.5, "blades"),
        ("trapeze:aperture:blades", "Double", NAN, "blades"),
        ("trapeze:aperture:blades", "String", "x", "the type string"),
        ("trapeze:aperture:rotation", "Float", NAN, "rotation"),
        ("trapeze:aperture:ratio", "Float", 0.0, "ratio"),
        ("trapeze:aperture:ratio", "Float", -INF, "ratio"),
        ("trapeze:aperture:roundness", "Float", 2.0, "roundness"),
        ("primvars:arnold:aperture_blade_curvature", "Float", -3.0, "roundness"),
        ("trapeze:shutter:curve", "Float2Array", [(0, 0), (1, 0)], "never opens"),
        ("trapeze:shutter:curve", "Float2Array", [(0, 1), (2, 1)], "position 2"),
        ("trapeze:shutter:curve", "Float2Array", [(1, 1), (0, 1)], "ascend"),
        ("trapeze:shutter:curve", "Float2Array", [(0, NAN), (1, 1)], "openness"),
        ("trapeze:shutter:curve", "FloatArray", [0, 1], "the type float[], where float2[]"),
        ("ri:shutterOpenTime", "Float", 1.5, "position"),
        ("ri:shutteropening", "FloatArray", [0, 1, 2], "8 numbers"),
    ],
)
def test_bad_lenses_and_shutters(stage, name, kind, value, words):
    prim = stage.GetPrimAtPath("/camera")
    prim.CreateAttribute(name, getattr(Sdf.ValueTypeNames, kind)).Set(value)
    image = render(stage, shutter=(0, 1))
    one_warning(image, "/camera", words)
    np.testing.assert_array_equal(image.alpha, quad_coverage(*GOOD))


def test_bad_numbers_in_a_changing_lens_are_told_once(stage):
    camera = UsdGeom.Camera.Get(stage, "/camera")
    set_samples(camera.GetFocalLengthAttr(), {0: 20.0, 0.3: NAN, 0.6: -1.0, 1: 20.0})
    image = render(stage, shutter=(0, 1))
    one_warning(image, "/camera", "give no view")
    assert np.isfinite(image["color"]).all()


def test_a_stereo_role_is_nothing_to_warn_of(stage):
    UsdGeom.Camera.Get(stage, "/camera").GetStereoRoleAttr().Set("left")
    assert render(stage).warnings == []


def test_nothing_to_render_is_said_beside_other_warnings():
    stage = new_stage()
    add_camera(stage, projection="fisheye")
    texts = [text for _, _, text in render(stage).warnings]
    assert len(texts) == 2
    assert any("nothing to render" in text for text in texts)


def test_empty_stage():
    stage = new_stage()
    image = render(stage)
    assert not image["color"].any()
    assert len(image.warnings) == 1
    assert "nothing to render" in image.warnings[0][2]


@pytest.mark.parametrize("kind", [UsdGeom.TetMesh, UsdGeom.HermiteCurves])
def test_what_is_not_supported_is_named(stage, kind):
    kind.Define(stage, "/other")
    one_warning(render(stage), "/other", "not supported yet")


def test_a_closed_renderer_says_so(stage):
    with Renderer(Options(width=8, height=8, samples=1)) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
    for use in (lambda: renderer.aov("color"), renderer.render, renderer.statistics):
        with pytest.raises(SceneError, match="The renderer is closed"):
            use()


def test_models_with_a_draw_mode_are_named(stage):
    parent = UsdGeom.Xform.Define(stage, "/model")
    add_quad(stage, "/model/quad")
    Usd.ModelAPI(parent).SetKind("component")
    model = UsdGeom.ModelAPI.Apply(parent.GetPrim())
    model.CreateModelApplyDrawModeAttr(True)
    model.CreateModelDrawModeAttr("bounds")
    one_warning(render(stage), "/model", "draw mode bounds")
    assert render(stage, draw_modes=False).warnings == []
    # Components need not say that it applies, but may say that it does not; others must.
    model.CreateModelApplyDrawModeAttr(False)
    assert render(stage).warnings == []
    model.GetModelApplyDrawModeAttr().Clear()
    one_warning(render(stage), "/model", "draw mode bounds")
    Usd.ModelAPI(parent).SetKind("group")
    assert render(stage).warnings == []


def test_unknown_aov(stage):
    image_warnings = render_with_unknown_aov(stage)
    assert len(image_warnings) == 1
    assert "nonsense" in image_warnings[0][2]


def render_with_unknown_aov(stage):
    options = Options(width=8, height=8, samples=1, camera="/camera", aovs=["color", "nonsense"])
    with Renderer(options) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        return list(renderer.log.warnings)


def test_an_instancer_that_ends_in_itself_is_framed_without_it(tmp_path):
    stage = Usd.Stage.CreateInMemory()
    add_quad(stage, "/quad")
    for name, other in (("a", "b"), ("b", "a")):
        instancer = UsdGeom.PointInstancer.Define(stage, f"/{name}")
        instancer.CreatePrototypesRel().SetTargets([f"/{other}"])
        instancer.CreateProtoIndicesAttr([0])
        instancer.CreatePositionsAttr([(0, 0, 0)])
    with Renderer(Options(width=8, height=8, samples=1)) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        assert renderer.aov("color").any()


def test_unknown_types_and_inactive_prototypes_are_named(stage):
    stage.DefinePrim("/what", "Foo")
    one_warning(render(stage), "/what", "Foo")
    stage.RemovePrim("/what")
    instancer = UsdGeom.PointInstancer.Define(stage, "/points")
    prototype = add_quad(stage, "/points/gone")
    prototype.GetPrim().SetActive(False)
    instancer.CreatePrototypesRel().SetTargets(["/points/gone"])
    instancer.CreateProtoIndicesAttr([0])
    instancer.CreatePositionsAttr([(0, 0, 0)])
    image = render(stage)
    assert any("is not active" in warning[2] for warning in image.warnings), image.warnings


def add_nest(stage, path, depth, count):
    """An instancer of `count` instances whose prototype is such an instancer, and so on."""
    for _ in range(depth):
        instancer = UsdGeom.PointInstancer.Define(stage, path)
        path += "/i"
        instancer.CreatePrototypesRel().SetTargets([path])
        instancer.CreateProtoIndicesAttr([0] * count)
        instancer.CreatePositionsAttr([Gf.Vec3f(0.01 * i, 0, 0) for i in range(count)])
        UsdGeom.Cube.Define(stage, path)  # the last stays one


def test_hundreds_of_nested_instancers_are_rendered(stage):
    add_nest(stage, "/nest", 400, 1)
    image = render(stage, aovs=("color", "instanceId"))
    assert image.warnings == []
    assert image["instanceId"][pixel(0.1, 0.1)] == 0


def test_what_no_memory_holds_is_counted_and_not_placed(stage):
    add_nest(stage, "/bad", 12, 10)
    image = check(stage, "it places 1000000000000 instances", "left out", shown=False)
    assert image.statistics["total_seconds"] < 1.0
    assert image.statistics["instances"] == 1


def test_native_instances_that_no_memory_holds_are_counted_and_not_placed(stage):
    stage.CreateClassPrim("/level0")
    UsdGeom.Cube.Define(stage, "/level0/cube")
    for level in range(1, 13):
        stage.CreateClassPrim(f"/level{level}")
        for i in range(10):
            xform = UsdGeom.Xform.Define(stage, f"/level{level}/part{i}" if level < 12 else "/bad")
            xform.GetPrim().GetReferences().AddInternalReference(f"/level{level - 1}")
            xform.GetPrim().SetInstanceable(level < 12)
    check(stage, "it places 100000000000 instances", "left out", path="/bad/part0", shown=False)


def test_doubles_beyond_32_bits_are_said_to_be(stage):
    prim = UsdGeom.Cube.Define(stage, "/bad").GetPrim()
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("far", Sdf.ValueTypeNames.DoubleArray)
    primvar.Set([1e300])
    image = render(stage, aovs=["color", "primvars:far"])
    (text,) = (text for path, _, text in image.warnings if path == "/bad")
    assert text == "primvar far has values that are not finite as 32-bit numbers; it is ignored"
