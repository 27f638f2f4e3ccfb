"""Primvars of point instancers: a value for each instance, by color, opacity and AOV."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from pxr import Gf, Sdf, UsdGeom
from scenes import SIZE, add_camera, add_quad, new_stage, pixel, render, set_samples

RED, GREEN, BLUE = (1, 0, 0), (0, 1, 0), (0, 0, 1)
COLOR = Sdf.ValueTypeNames.Color3fArray


def give(prim, values, name="displayColor", interpolation="vertex", kind=COLOR):
    """Authors a primvar."""
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation)
    if values is not None:
        primvar.Set(values)
    return primvar


def add_instancer(stage, path, target, positions):
    """Instances of one prototype, which may be anywhere."""
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(target)])
    instancer.CreateProtoIndicesAttr([0] * len(positions))
    instancer.CreatePositionsAttr([Gf.Vec3f(*map(float, p)) for p in positions])
    return instancer


def row(count=3, color=None, inside=True):
    """`count` unit quads 2 apart in a row."""
    stage = new_stage()
    add_camera(stage)
    quad = "/row/quad" if inside else "/library/quad"
    UsdGeom.Scope.Define(stage, "/library").MakeInvisible()
    places = [(2 * i - count + 1, 0, 0) for i in range(count)]
    row = add_instancer(stage, "/row", quad, places)
    add_quad(stage, quad, -0.5, -0.5, 0.5, 0.5, color=color)
    return stage, row


def at(image, x, y=0, name="color"):
    """A pixel near (x, y)."""
    return image[name][pixel(x + 0.1, y + 0.1)]


def hues(image, *places):
    """Which channels are lit at places in a row."""
    lit = {(0, 0, 0): ".", RED: "r", GREEN: "g", BLUE: "b", (1, 1, 1): "w"}
    return "".join(lit[tuple((at(image, x)[:3] > 0.05).astype(int).tolist())] for x in places)


@pytest.mark.parametrize("interpolation", ["vertex", "varying", "faceVarying", "uniform"])
def test_each_instance_has_its_color(interpolation):
    stage, instancer = row()
    give(instancer, [RED, GREEN, BLUE], interpolation=interpolation)
    image = render(stage)
    assert hues(image, -2, 0, 2) == "rgb"
    flat = new_stage()
    add_camera(flat)
    for x, color in ((-2, RED), (0, GREEN), (2, BLUE)):
        add_quad(flat, f"/at{x + 2}", x - 0.5, -0.5, x + 0.5, 0.5, color=color)
    np.testing.assert_allclose(image["color"], render(flat)["color"], atol=1e-6)
    assert image.warnings == []


def test_values_are_by_index_whatever_the_ids_and_masks():
    stage, instancer = row(4)
    give(instancer, [RED, GREEN, BLUE, RED])
    instancer.CreateIdsAttr([7, 3, 1, 0])
    instancer.CreateInvisibleIdsAttr([3])
    assert hues(render(stage), -3, -1, 1, 3) == "r.br"
    instancer.CreateProtoIndicesAttr([0, 1, 1, 0])
    add_quad(stage, "/row/other", -0.3, -0.3, 0.3, 0.3, color=None)
    instancer.GetPrototypesRel().AddTarget("/row/other")
    assert hues(render(stage), -3, -1, 1, 3) == "r.br"


def test_what_the_prototype_has_itself_wins():
    stage, instancer = row(color=(1, 1, 1))
    give(instancer, [RED, GREEN, BLUE])
    image = render(stage)
    assert hues(image, -2, 0, 2) == "www"
    assert image.warnings == []


def test_it_counts_as_authored_at_the_root_of_each_instance():
    stage, instancer = row(inside=False)
    give(stage.GetPrimAtPath("/library"), [(1, 1, 1)], interpolation="constant")
    assert hues(render(stage), -2, 0, 2) == "www"
    give(instancer, [RED, GREEN, BLUE])
    assert hues(render(stage), -2, 0, 2) == "rgb", "nearer than what is above the prototype"
    instancer.GetPrototypesRel().SetTargets(["/library"])
    stage.GetPrimAtPath("/library").GetAttribute("visibility").Set("inherited")
    assert at(render(stage), -2)[1] > 0.05, "the root of the prototype has a color of its own"


@pytest.mark.parametrize("inside", [True, False])
def test_one_value_for_all(inside):
    stage, instancer = row(inside=inside)
    give(instancer, [GREEN], interpolation="constant")
    assert hues(render(stage), -2, 0, 2) == "ggg"
    give(instancer, [BLUE], interpolation="vertex")
    image = render(stage)
    assert hues(image, -2, 0, 2) == "bbb"
    assert image.warnings == []


def test_indices_and_time():
    stage, instancer = row()
    primvar = give(instancer, [GREEN, RED])
    primvar.SetIndices([1, 0, 1])
    assert hues(render(stage), -2, 0, 2) == "rgr"
    stage, instancer = row()
    primvar = give(instancer, None)
    set_samples(primvar.GetAttr(), {0: [RED, GREEN, BLUE], 10: [BLUE, GREEN, RED]})
    assert hues(render(stage, 0), -2, 0, 2) == "rgb"
    assert hues(render(stage, 10), -2, 0, 2) == "bgr"
    halfway = render(stage, 5)
    lit = at(halfway, -2)
    assert lit[0] == pytest.approx(lit[2])
    assert lit[0] == pytest.approx(at(halfway, 0)[1] / 2, rel=0.01)


def test_wrong_values_give_one_warning():
    for values, kind in (([RED, GREEN], COLOR), (["a", "b", "c"], Sdf.ValueTypeNames.StringArray)):
        stage, instancer = row()
        give(instancer, values, kind=kind)
        image = render(stage)
        assert [path for path, *_ in image.warnings] == ["/row"], image.warnings
        assert hues(image, -2, 0, 2) == "www", "grey, as without it"


def nest(outer, inner):
    """Two rows of two, and colors or none for each of the instancers."""
    stage = new_stage()
    add_camera(stage)
    add_instancer(stage, "/outer", "/outer/inner", [(0, -2, 0), (0, 2, 0)])
    add_instancer(stage, "/outer/inner", "/outer/inner/quad", [(-2, 0, 0), (2, 0, 0)])
    add_quad(stage, "/outer/inner/quad", -0.5, -0.5, 0.5, 0.5, color=None)
    for path, colors in (("/outer", outer), ("/outer/inner", inner)):
        if colors:
            give(stage.GetPrimAtPath(path), colors)
    return stage


def test_the_innermost_instancer_wins():
    def lit(stage):
        image = render(stage)
        places = ((-2, -2), (2, -2), (-2, 2), (2, 2))
        return "".join("rgb"[int(np.argmax(at(image, *place)[:3]))] for place in places)

    assert lit(nest([RED, GREEN], None)) == "rrgg"
    assert lit(nest(None, [RED, GREEN])) == "rgrg"
    assert lit(nest([BLUE, BLUE], [RED, GREEN])) == "rgrg"
    stage = nest([BLUE, GREEN], None)
    give(stage.GetPrimAtPath("/outer/inner"), [RED], interpolation="constant")
    assert lit(stage) == "rrrr"


def test_color_and_opacity_of_different_instancers():
    stage = nest([RED, GREEN], None)
    opacity = Sdf.ValueTypeNames.FloatArray
    give(stage.GetPrimAtPath("/outer/inner"), [1.0, 0.25], "displayOpacity", kind=opacity)
    add_quad(stage, "/behind", -5, -5, 5, 5, z=-1, color=BLUE)
    image = render(stage)
    solid, thin = at(image, -2, 2), at(image, 2, 2)
    assert solid[1] > 0.05 and solid[2] == 0
    assert thin[1] == pytest.approx(solid[1] / 4, rel=0.01)
    assert thin[2] > 2 * thin[1]
    assert at(image, -2, -2)[0] > 0.05


def test_any_primvar_as_an_aov():
    stage, instancer = row()
    give(instancer, [5, -7, 1 << 20], "number", kind=Sdf.ValueTypeNames.IntArray)
    give(instancer, [0.5, 1.5, 2.5], "weight", kind=Sdf.ValueTypeNames.FloatArray)
    names = ("primvars:number", "primvars:weight", "primvars:displayColor")
    give(instancer, [RED, GREEN, BLUE])
    image = render(stage, aovs=("color", "instanceId", *names))
    assert [at(image, x, name="primvars:number") for x in (-2, 0, 2)] == [5, -7, 1 << 20]
    assert [at(image, x, name="primvars:weight") for x in (-2, 0, 2)] == [0.5, 1.5, 2.5]
    assert at(image, 2, name="primvars:displayColor").tolist() == list(BLUE)
    assert [at(image, x, name="instanceId") for x in (-2, 0, 2)] == [0, 1, 2]
    assert image.warnings == []


def test_each_native_instance_inherits_its_own_color():
    stage = new_stage()
    add_camera(stage)
    stage.CreateClassPrim("/quad")
    add_quad(stage, "/quad/mesh", -0.5, -0.5, 0.5, 0.5, color=None)
    for x, color in ((-2, RED), (0, GREEN), (2, BLUE)):
        xform = UsdGeom.Xform.Define(stage, f"/at{x + 2}")
        xform.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/quad")
        xform.GetPrim().SetInstanceable(True)
        give(xform, [color], interpolation="constant")
    image = render(stage, aovs=("color", "instanceId"))
    assert hues(image, -2, 0, 2) == "rgb"
    # What two native instances in a prototype inherit is nearer than what the instancer gives.
    instancer = add_instancer(stage, "/many", "/many/pair", [(0, -2, 0), (0, 2, 0)])
    give(instancer, [BLUE, RED])
    for x, color in ((-1, GREEN), (1, None)):
        xform = UsdGeom.Xform.Define(stage, f"/many/pair/at{x + 1}")
        xform.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/quad")
        xform.GetPrim().SetInstanceable(True)
        if color:
            give(xform, [color], interpolation="constant")
    image = render(stage)
    lit = ["rgb"[int(np.argmax(at(image, x, y)[:3]))] for y in (-2, 2) for x in (-1, 1)]
    assert lit == ["g", "b", "g", "r"]


def test_the_next_frame_has_its_own_colors():
    stage, instancer = row()
    primvar = give(instancer, None)
    set_samples(primvar.GetAttr(), {0: [RED, GREEN, BLUE], 1: [BLUE, BLUE, RED]})
    options = Options(width=SIZE, height=SIZE, samples=1, camera="/camera")
    with Renderer(options) as renderer:
        found = []
        for frame in (0, 1):
            renderer.load(stage, frame)
            renderer.render()
            found.append(hues({"color": renderer.aov("color")}, -2, 0, 2))
        give(instancer, None).GetAttr().Block()
        renderer.load(stage, 1)
        renderer.render()
        found.append(hues({"color": renderer.aov("color")}, -2, 0, 2))
    assert found == ["rgb", "bbr", "www"]
