"""RenderPass: its collections, by relationships and by expressions."""

import hdtrapeze
import numpy as np
import pytest
from hdtrapeze.log import SceneLog
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender
from scenes import add_camera, add_quad, new_stage, one_warning, quad_coverage, render

ALL = quad_coverage(-4, -2, -2, 2) + quad_coverage(2, -2, 4, 2)
LEFT, RIGHT = quad_coverage(-4, -2, -2, 2), quad_coverage(2, -2, 4, 2)


@pytest.fixture
def stage():
    """Two quads side by side: /World/left, and /World/right/quad."""
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, "/World/left", -4, -2, -2, 2)
    UsdGeom.Xform.Define(stage, "/World/right")
    add_quad(stage, "/World/right/quad", 2, -2, 4, 2)
    return stage


def collection(stage, name, **values):
    """A collection of /pass: includes, excludes, or `expression` and other attributes."""
    render_pass = UsdRender.Pass.Define(stage, "/pass")
    api = Usd.CollectionAPI.Get(render_pass.GetPrim(), name)
    for path in values.pop("includes", ()):
        api.CreateIncludesRel().AddTarget(path)
    for path in values.pop("excludes", ()):
        api.CreateExcludesRel().AddTarget(path)
    if "expression" in values:
        api.CreateMembershipExpressionAttr(Sdf.PathExpression(values.pop("expression")))
    for key, value in values.items():
        render_pass.GetPrim().GetAttribute(f"collection:{name}:{key}").Set(value)
    return render_pass


def through(stage, render_pass, **settings):
    return render(stage, render_pass=render_pass, **settings)


@pytest.mark.parametrize("name", ["renderVisibility", "cameraVisibility"])
def test_visibility_by_relationships(stage, name):
    render_pass = collection(stage, name)
    np.testing.assert_array_equal(through(stage, render_pass).alpha, ALL)
    collection(stage, name, excludes=["/World/right"])
    np.testing.assert_array_equal(through(stage, render_pass).alpha, LEFT)
    collection(stage, name, includes=["/World/right/quad"])
    np.testing.assert_array_equal(through(stage, render_pass).alpha, ALL)
    collection(stage, name, includeRoot=False, includes=["/World/right/quad"])
    np.testing.assert_array_equal(through(stage, render_pass).alpha, RIGHT)


def test_visibility_by_expressions(stage):
    render_pass = collection(stage, "renderVisibility", includeRoot=False, expression="/World/r*//")
    np.testing.assert_array_equal(through(stage, render_pass).alpha, RIGHT)
    # A pattern has to reach the geometry itself.
    collection(stage, "renderVisibility", expression="/World/right")
    assert not through(stage, render_pass).alpha.any()
    collection(stage, "renderVisibility", expression="//{isa:Mesh} - /World/left")
    np.testing.assert_array_equal(through(stage, render_pass).alpha, RIGHT)


def test_an_expression_that_does_not_count_is_said(stage):
    render_pass = collection(stage, "renderVisibility", expression="/World/right//")
    image = through(stage, render_pass)
    np.testing.assert_array_equal(image.alpha, ALL)
    one_warning(image, "/pass", "renderVisibility", "includeRoot = 0")
    collection(stage, "renderVisibility", mode="expression")
    image = through(stage, render_pass)
    np.testing.assert_array_equal(image.alpha, RIGHT)
    assert image.warnings == []


def test_prune_takes_all_below(stage):
    render_pass = collection(stage, "prune", expression="/World/right")
    np.testing.assert_array_equal(through(stage, render_pass).alpha, LEFT)
    image = through(stage, collection(stage, "prune", includes=["/World/left"], expression="//x"))
    np.testing.assert_array_equal(image.alpha, RIGHT)
    image = through(stage, collection(stage, "prune", includes=["/World/right"]))
    assert not image.alpha.any()
    one_warning(image, "/pass", "membershipExpression of its collection prune")


def test_matte_holds_out_what_is_behind(stage):
    add_quad(stage, "/behind", -5, -1, 5, 1, z=-2.0)
    render_pass = collection(stage, "matte", includes=["/World/left"])
    aovs = ("color", "primId", "depth", "normal")
    without = render(stage, aovs=aovs)
    image = through(stage, render_pass, aovs=aovs)
    held = LEFT > 0
    for name, background in (("color", 0), ("primId", -1), ("depth", 1), ("normal", 0)):
        assert (without[name][held] != background).any(), name
        np.testing.assert_array_equal(image[name][held], background)
        np.testing.assert_array_equal(image[name][~held], without[name][~held])
    # In front of it, what is no matte object stays.
    add_quad(stage, "/front", -3, -1, -2, 1, z=1.0)
    image = through(stage, render_pass)
    np.testing.assert_array_equal(image.alpha[18:22, 8:11], 1.0)


@pytest.mark.parametrize("opacity", [0.0, 0.25, 1.0])
def test_a_transparent_matte_object_holds_out_its_share(stage, opacity):
    stage.RemovePrim("/World/left")
    matte = add_quad(stage, "/World/left", -4, -2, -2, 2)
    matte.CreateDisplayOpacityAttr([opacity])
    add_quad(stage, "/behind", -6, -6, 6, 6, z=-2.0)
    render_pass = collection(stage, "matte", includes=["/World/left"])
    image = through(stage, render_pass, aovs=("color", "primId"))
    centre = image["color"][20, 8]
    np.testing.assert_allclose(centre[3], 1 - opacity, atol=1e-6)
    np.testing.assert_allclose(centre[:3], (1 - opacity) * image["color"][20, 20, :3], atol=1e-6)
    assert image["primId"][20, 8] == (-1 if opacity else image["primId"][20, 20])


def instanced(stage):
    """Two native instances of a quad, /a at x = -3 and /b at x = 3."""
    stage.CreateClassPrim("/proto")
    add_quad(stage, "/proto/quad", -1, -2, 1, 2)
    for name, x in (("/a", -3), ("/b", 3)):
        xform = UsdGeom.Xform.Define(stage, name)
        xform.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/proto")
        xform.GetPrim().SetInstanceable(True)
    stage.RemovePrim("/World")


def test_native_instances_go_by_their_own_paths(stage):
    instanced(stage)
    render_pass = collection(stage, "renderVisibility", excludes=["/a"])
    np.testing.assert_array_equal(through(stage, render_pass).alpha, RIGHT)
    stage.RemovePrim("/pass")
    render_pass = collection(stage, "prune", includes=["/b"])
    np.testing.assert_array_equal(through(stage, render_pass).alpha, LEFT)
    stage.RemovePrim("/pass")
    render_pass = collection(stage, "matte", includes=["/b/quad"])
    add_quad(stage, "/behind", -6, -6, 6, 6, z=-2.0)
    np.testing.assert_array_equal(through(stage, render_pass).alpha, 1.0 - RIGHT)


def test_point_instancers(stage):
    stage.RemovePrim("/World")
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/instancer")
    stage.CreateClassPrim("/protos")
    add_quad(stage, "/protos/left", -1, -2, 1, 2)
    add_quad(stage, "/World/instancer/right", -1, -2, 1, 2)
    instancer.CreatePrototypesRel().SetTargets(["/protos/left", "/World/instancer/right"])
    instancer.CreatePositionsAttr([Gf.Vec3f(-3, 0, 0), Gf.Vec3f(3, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 1])

    def alpha(name, **values):
        stage.RemovePrim("/pass")
        return through(stage, collection(stage, name, **values)).alpha

    none = np.zeros_like(ALL)
    only = {"includeRoot": False, "includes": ["/World"]}
    right = ["/World/instancer/right"]
    np.testing.assert_array_equal(alpha("renderVisibility", **only), ALL)
    np.testing.assert_array_equal(alpha("renderVisibility", excludes=["/World"]), none)
    np.testing.assert_array_equal(alpha("renderVisibility", excludes=right), LEFT)
    np.testing.assert_array_equal(alpha("prune", includes=["/World/instancer"]), none)
    np.testing.assert_array_equal(alpha("prune", includes=["/protos"]), RIGHT)
    np.testing.assert_array_equal(alpha("matte", includes=right), LEFT)
    np.testing.assert_array_equal(alpha("matte", includes=["/World/instancer"]), none)


def test_matte_objects_come_and_go_between_frames(stage):
    """Visibility that is animated keeps its place in the pass."""
    visibility = UsdGeom.Imageable.Get(stage, "/World/left").CreateVisibilityAttr()
    visibility.Set("inherited", 0)
    visibility.Set("invisible", 1)
    visibility.Set("inherited", 2)
    render_pass = collection(stage, "matte", includes=["/World/left"])
    add_quad(stage, "/behind", -6, -6, 6, 6, z=-2.0)
    with hdtrapeze.Renderer(
        width=40, height=40, samples=4, filter="box", camera="/camera", render_pass=render_pass
    ) as renderer:
        for frame, held in ((0, LEFT), (1, 0 * LEFT), (2, LEFT)):
            renderer.load(stage, frame)
            renderer.render()
            np.testing.assert_array_equal(renderer.aov("color")[..., 3], 1.0 - held)
        assert "matte objects: some, called for by /World/left" in renderer.explain()


def test_collections_that_cannot_be_are_one_warning(stage):
    render_pass = collection(stage, "matte", includes=["/pass.collection:prune"])
    collection(stage, "prune", includes=["/pass.collection:matte"])
    collection(stage, "renderVisibility", mode="expression", expression="//{nonsense:1}")
    log = SceneLog()
    hdtrapeze.Renderer(log=log, render_pass=render_pass).close()
    assert [path for path, *_ in log.warnings] == ["/pass"] * 3, log.warnings
    for name, why in (("matte", "circular"), ("prune", "circular"), ("renderVis", "nonsense")):
        assert any(name in text and why in text for *_, text in log.warnings), log.warnings
    np.testing.assert_array_equal(through(stage, render_pass).alpha, ALL)


@pytest.mark.parametrize("name", ["prune", "matte", "renderVisibility"])
def test_prims_that_are_not_there(stage, name):
    image = through(stage, collection(stage, name, includes=["/World", "/Wrold/left"]))
    one_warning(image, "/pass", f"collection {name} names /Wrold/left, which is no prim")
