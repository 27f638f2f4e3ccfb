"""Instancers in every nesting, moving, edited and broken, through Hydra's hosts."""

from itertools import pairwise

import instance_scenes
import numpy as np
import pytest
from authored import export, same, vectors
from images import read_exr
from pxr import Sdf, UsdGeom
from scenes import set_samples


def rates(stage):
    """As of instance_scenes, with two samples: hosts know no times of single ones."""
    instance_scenes.rates(stage)
    prim = stage.GetPrimAtPath("/i")
    for name in ("positions", "velocities", "accelerations", "orientations", "angularVelocities"):
        attribute = prim.GetAttribute(name)
        value = attribute.Get(-0.25)
        attribute.Clear()
        set_samples(attribute, {-0.25: value, 5: value})


def several_prototypes(stage):
    """Three prototypes, one of two parts, with velocities, colors and a moving instancer."""
    for path, half in (("/i/a", 0.3), ("/i/b", 0.2), ("/i/c/x", 0.2), ("/i/c/y", 0.15)):
        instance_scenes.box(stage, path, half)
    UsdGeom.Xformable(stage.GetPrimAtPath("/i/c/y")).AddTranslateOp().Set((0.5, 0, 0))
    places = [(i % 4 * 2.2 - 3.5, i // 4 * 2.2 - 2.5, 0) for i in range(12)]
    kinds = [i % 3 for i in range(12)]
    instancer = instance_scenes.points(stage, "/i", ["/i/a", "/i/b", "/i/c"], kinds, places)
    for time in (0, 1):
        instancer.GetPositionsAttr().Set(vectors(places), time)
        speeds = vectors([(24 * (i % 2), 36 * (i // 2 % 2), 0) for i in range(12)])
        instancer.CreateVelocitiesAttr().Set(speeds, time)
    set_samples(instancer.AddTranslateOp().GetAttr(), {-1: (0, -0.5, 0), 1: (0, 0.5, 0)})
    kind = Sdf.ValueTypeNames.Color3fArray
    color = UsdGeom.PrimvarsAPI(instancer).CreatePrimvar("displayColor", kind, "vertex")
    color.Set(vectors([(i / 12, 1 - i / 12, 0.5) for i in range(12)]))
    instancer.CreateInvisibleIdsAttr([1, 5])


def changing_number(stage):
    instance_scenes.box(stage, "/i/a", 0.3)
    instancer = instance_scenes.points(stage, "/i", ["/i/a"], [], [])
    for time, count in ((-1, 2), (0, 3), (1, 5)):
        places = [(1.5 * i - 3 + 0.3 * time, 0, 0) for i in range(count)]
        instancer.GetPositionsAttr().Set(vectors(places), time)
        instancer.GetProtoIndicesAttr().Set([0] * count, time)


def changing_number_with_velocities(stage):
    changing_number(stage)
    instancer = UsdGeom.PointInstancer.Get(stage, "/i")
    for time, count in ((-1, 2), (0, 3), (1, 5)):
        instancer.CreateVelocitiesAttr().Set(vectors([(0, 48, 0)] * count), time)


@pytest.mark.parametrize(("author", "opens", "closes", "frame"), [
    (instance_scenes.three, 0.0, 0.0, 0.0),
    (instance_scenes.full_precision, 0.0, 0.0, 0.0),
    (instance_scenes.points_in_points, 0.0, 0.0, 0.0),
    (instance_scenes.hidden, 0.0, 0.0, 0.0),
    (rates, 0.0, 0.5, 0.0),
    (rates, -0.1, 0.1, 0.0),
    (rates, 0.0, 0.0, 0.0),
    (several_prototypes, -0.25, 0.25, 0.0),
    (changing_number_with_velocities, -0.25, 0.25, 0.5),
])  # fmt: skip
def test_instances(host, author, opens, closes, frame):
    same(host, author, opens, closes, frame)


@pytest.mark.parametrize("author", [
    instance_scenes.natives_in_points,
    instance_scenes.natives_in_natives,
])  # fmt: skip
def test_natives_that_inherit_colors(index_host, author):
    """Scene delegates do not hand on colors to native instances within others."""
    same(index_host, author)


@pytest.mark.parametrize("frame", [0.0, 0.5, 1.0])
def test_the_number_of_instances_changes(host, frame):
    text = "the number of instances changes around the shutter; they do not move (time-samples)"
    same(host, changing_number, -0.25, 0.25, frame, warned=[("/i", text)])


def test_a_prototype_is_used_outside_of_its_native_instance(index_host):
    """25.02's scene indices name an instancer that is not there."""
    scene = export(index_host, instance_scenes.points_in_natives)
    script = 'record(Usd.Stage.Open(scene), "hydra.exr", "/camera", 0.0)'
    ((path, text),) = index_host.run(script, scene=scene).warnings
    assert path.startswith("/far/")
    assert text.endswith("is not there; it has no instances")


EDITS = """
def box(path, half):
    mesh = UsdGeom.Mesh.Define(stage, path)
    square = (-1, -1), (1, -1), (1, 1), (-1, 1)
    mesh.CreatePointsAttr([(x * half, y * half, 0) for x, y in square])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    return mesh

def instances(places, kinds):
    instancer = UsdGeom.PointInstancer.Get(stage, "/i")
    instancer.GetPositionsAttr().Set(places)
    instancer.GetProtoIndicesAttr().Set(kinds)

def again():
    UsdGeom.PointInstancer.Define(stage, "/i").CreatePrototypesRel().SetTargets(["/i/p"])
    box("/i/p", 0.7)
    instances([(0, 3, 0)], [0])

EDITS = [
    lambda: box("/i/p/more", 0.25).AddTranslateOp().Set((0, 0.8, 0)),
    lambda: stage.RemovePrim("/i/p/a"),
    lambda: instances([(-2, 1, 0), (2, 1, 0), (0, -3, 0), (3, 3, 0)], [0, 1, 1, 1]),
    lambda: UsdGeom.Imageable.Get(stage, "/i").MakeInvisible(),
    lambda: UsdGeom.Imageable.Get(stage, "/i").MakeVisible(),
    lambda: instances([], []),
    lambda: instances([(0, 3, 0)], [1]),
    lambda: stage.GetPrimAtPath("/n1").SetInstanceable(False),
    lambda: UsdGeom.Xformable.Get(stage, "/n0").AddScaleOp().Set((2, 2, 2)),
    lambda: stage.GetPrimAtPath("/n1").SetInstanceable(True),
    lambda: stage.RemovePrim("/i/q"),
    lambda: stage.RemovePrim("/i"),
    again,
]
stage = Usd.Stage.Open(scene)
live = View(stage, "/camera", size=(48, 48), aov="P", samples=4)
live.render(0)
for number, change in enumerate(EDITS):
    change()
    live.render(0)
    live.save(f"live{number}.exr")
    fresh = View(stage, "/camera", size=(48, 48), aov="P", samples=4)
    fresh.render(0)
    fresh.save(f"fresh{number}.exr")
tell(edits=len(EDITS))
"""


def test_prims_enter_and_leave_prototypes(host):
    """After each edit, the view that lives on shows what a new one shows."""

    def author(stage):
        instance_scenes.box(stage, "/i/p/a")
        UsdGeom.Xformable(instance_scenes.box(stage, "/i/p/b", 0.2)).AddTranslateOp().Set((1, 0, 0))
        instance_scenes.box(stage, "/i/q", 0.3)
        kinds, places = [0, 1, 0], [(-3, 2, 0), (3, 2, 0), (0, -2, 0)]
        instance_scenes.points(stage, "/i", ["/i/p", "/i/q"], kinds, places)
        instance_scenes.library(stage)
        for i in range(2):
            instance_scenes.copy(stage, f"/n{i}", "/lib", i - 0.5, 0, 0)

    scene = export(host, author)
    ran = host.run(EDITS, scene=scene)

    def places(name):
        channels = read_exr(ran.folder / name)
        return np.stack([channels[f"P.{axis}"] for axis in "XYZ"])

    images = [places(f"live{i}.exr") for i in range(ran.told["edits"])]
    for i, image in enumerate(images):
        np.testing.assert_array_equal(image, places(f"fresh{i}.exr"), str(i))
    changed = [(a != b).any() for a, b in pairwise(images)]
    assert sum(changed) >= 9


HANDS = """
def show(*prototypes):
    with Sdf.ChangeBlock():
        for name, prototype in zip("ij", prototypes):
            UsdGeom.PointInstancer.Get(stage, f"/{name}").GetPrototypesRel().SetTargets([prototype])

stage = Usd.Stage.Open(scene)
live = View(stage, "/camera", size=(48, 48), aov="P", samples=4)
live.render(0)
hands = [("/leaf", "/nested"), ("/nested", "/leaf"), ("/nested", "/nested"), ("/leaf", "/nested")]
for number, prototypes in enumerate(hands):
    show(*prototypes)
    live.render(0)
    live.save(f"live{number}.exr")
    fresh = View(stage, "/camera", size=(48, 48), aov="P", samples=4)
    fresh.render(0)
    fresh.save(f"fresh{number}.exr")
"""


def test_a_nested_instancer_changes_hands(index_host):
    """It is another instancer's prototype after an edit, which scene delegates tell nobody of."""

    def author(stage):
        instance_scenes.box(stage, "/leaf", 0.3)
        instance_scenes.box(stage, "/nested/part", 0.2)
        instance_scenes.points(stage, "/nested", ["/nested/part"], [0, 0], [(0, 0, 0), (0, 1, 0)])
        for x, name in ((-3, "i"), (2, "j")):
            path, places = f"/{name}", [(x, 0, 0), (x + 1.5, 1, 0)]
            instance_scenes.points(stage, path, ["/nested"], [0, 0], places)

    ran = index_host.run(HANDS, scene=export(index_host, author))
    assert ran.warnings == []
    images = [read_exr(ran.folder / f"live{i}.exr") for i in range(4)]
    for i, image in enumerate(images):
        fresh = read_exr(ran.folder / f"fresh{i}.exr")
        for axis in "XYZ":
            np.testing.assert_array_equal(image[f"P.{axis}"], fresh[f"P.{axis}"], str(i))
    assert all((a["P.X"] != b["P.X"]).any() for a, b in pairwise(images))


def test_several_values_for_each_instance(host):
    """Hosts before 26.08 do not say so: rather no values than those of others, and one warning."""

    def author(stage, size):
        instance_scenes.box(stage, "/i/a", 0.3)
        instance_scenes.box(stage, "/i/b", 0.4)
        places = [(i * 2 - 3, 0, 0) for i in range(4)]
        instancer = instance_scenes.points(stage, "/i", ["/i/a", "/i/b"], [0, 1, 0, 1], places)
        kind = Sdf.ValueTypeNames.Color3fArray
        color = UsdGeom.PrimvarsAPI(instancer).CreatePrimvar("displayColor", kind, "vertex", size)
        color.Set(vectors([(i / 8, 1, 0) for i in range(4 * size)]))

    same(host, lambda stage: author(stage, 1))
    text = "primvar displayColor has 8 values where its instancer has 4 instances; it is ignored"
    text += " (primvar-length)"
    scene = export(host, lambda stage: author(stage, 2))
    script = """
    view = View(Usd.Stage.Open(scene), "/camera", samples=1)
    view.render(0)
    view.save("view.exr")
    """
    ran = host.run(script, scene=scene)
    assert ran.warnings == [("/i", text)]
    image = ran.image("view.exr")
    np.testing.assert_array_equal(image[..., 0], image[..., 1])


HIDDEN_NATIVE = """#usda 1.0
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 30)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "left" (
    instanceable = true
    references = </part>
) {
    token visibility = "invisible"
    double3 xformOp:translate = (-2, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "right" (
    instanceable = true
    references = </part>
) {
    double3 xformOp:translate = (2, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
class Xform "part" {
    def Sphere "s" {
    }
}
"""


def halves(ran, name):
    """How much of the image's left and of its right half is covered."""
    alpha = read_exr(ran.folder / name)["A"]
    return [half.mean() > 0.001 for half in np.array_split(alpha, 2, axis=1)]


def test_a_native_instance_that_is_hidden_hides_no_other(host, tmp_path):
    scene = tmp_path / "natives.usda"
    scene.write_text(HIDDEN_NATIVE)
    ran = host.run(
        """stage = Usd.Stage.Open(scene)
view = View(stage, "/cam", size=(48, 32), samples=4)
for i, (left, right) in enumerate([(0, 1), (1, 1), (1, 0), (0, 0), (0, 1)]):
    for path, shown in (("/left", left), ("/right", right)):
        attribute = UsdGeom.Imageable(stage.GetPrimAtPath(path)).CreateVisibilityAttr()
        attribute.Set("inherited" if shown else "invisible")
    view.render()
    view.save(f"{i}.exr")""",
        scene=scene,
    )
    assert [halves(ran, f"{i}.exr") for i in range(5)] == [
        [False, True],
        [True, True],
        [True, False],
        [False, False],
        [False, True],
    ]


def test_visibility_of_an_instancer_changes_from_frame_to_frame(host, tmp_path):
    scene = tmp_path / "points.usda"
    scene.write_text(
        """#usda 1.0
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 30)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def PointInstancer "i" {
    point3f[] positions = [(-2, 0, 0), (2, 0, 0)]
    int[] protoIndices = [0, 0]
    rel prototypes = </i/a>
    token visibility.timeSamples = { 1: "invisible", 2: "inherited" }
    def Sphere "a" {
    }
}
"""
    )
    ran = host.run(
        """stage = Usd.Stage.Open(scene)
view = View(stage, "/cam", size=(48, 32), samples=4)
for i, frame in enumerate([1.0, 2.0, 1.0, 2.0]):
    view.render(frame)
    view.save(f"{i}.exr")""",
        scene=scene,
    )
    assert [halves(ran, f"{i}.exr") for i in range(4)] == [[False, False], [True, True]] * 2
