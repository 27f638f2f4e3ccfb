"""Edits between draws, and while a render is under way: the image becomes that of a new view."""

from pathlib import Path

import numpy as np
import pytest
from driver import read_exr

# What OpenUSD's scene delegate tells no renderer of: these two, and samples beside a still shutter
# of a prim with a blur scale.
UNTOLD = ("blur_scale", "no_prototype", "still")
# What changes no pixel.
UNSEEN = ("uninstance",)

SCENES = Path(__file__).parent / "scenes"

# After each edit, the view that saw it and a view that sees the stage for the first time.
COMPARE = """
stage = Usd.Stage.Open(scene)
view = View(stage, "/main_cam", interactive=False, samples=4)
frame = 2.0
view.render(frame)

def at(path):
    return stage.GetPrimAtPath(path)

done = []
for name, edit_stage in EDITS.items():
    if name in left_out:
        continue
    if name in ("time", "half"):
        frame = edit_stage()
    else:
        edit_stage()
    view.render(frame)
    view.save(f"{name}.seen.exr")
    view.dump(f"{name}.seen.txt")
    fresh = View(stage, "/main_cam", interactive=False, samples=4)
    fresh.render(frame)
    fresh.save(f"{name}.fresh.exr")
    fresh.dump(f"{name}.fresh.txt")
    done.append(name)
tell(done=done)
"""

MOTION = """
def add():
    mesh = UsdGeom.Mesh.Define(stage, "/Added")
    mesh.CreatePointsAttr([(-1, -1, 1), (1, -1, 1), (0, 1, 1)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateSubdivisionSchemeAttr("none")

def change_topology():
    mesh = UsdGeom.Mesh(at("/Added"))
    with Sdf.ChangeBlock():
        mesh.GetPointsAttr().Set([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])
        mesh.GetFaceVertexCountsAttr().Set([4])
        mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3])

EDITS = {
    "add": add,
    "topology": change_topology,
    "moves": lambda: edit(stage, "/Moves.xformOp:translate", Gf.Vec3d(-2, 3, 0), 3),
    "points": lambda: edit(
        stage, "/Deforms.points", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 2, 0)], 3),
    "velocity": lambda: edit(stage, "/Flies.velocities", [(0, 24, 0), (0, 24, 0), (0, 0, 0)], 2),
    "blur_scale": lambda: edit(stage, "/Slowed.motion:blurScale", 1.0),
    "color": lambda: edit(stage, "/Flies.primvars:displayColor", [(1, 1, 0)]),
    "hide": lambda: UsdGeom.Imageable(at("/Slowed")).MakeInvisible(),
    "show": lambda: UsdGeom.Imageable(at("/Slowed")).MakeVisible(),
    "purpose": lambda: UsdGeom.Imageable(at("/Colours")).CreatePurposeAttr("guide"),
    "deactivate": lambda: at("/Moves").SetActive(False),
    "activate": lambda: at("/Moves").SetActive(True),
    "remove": lambda: stage.RemovePrim("/Added"),
    "camera": lambda: edit(stage, "/main_cam.xformOp:translate", Gf.Vec3d(0.5, 0, 10)),
    "lens": lambda: edit(stage, "/main_cam.focalLength", 45.0),
    "shutter": lambda: edit(stage, "/main_cam.shutter:open", -0.5),
    "time": lambda: 1.0,
    "half": lambda: 2.5,
    "still": lambda: edit(stage, "/main_cam.shutter:open", 0.25),
    "shutter_again": lambda: edit(stage, "/main_cam.shutter:open", -0.25),
}
"""

INSTANCES = """
def inner():
    return UsdGeom.PointInstancer(at("/Forest/Prototypes/Inner"))

def forest():
    return UsdGeom.PointInstancer(at("/Forest"))

def count(n):
    instancer = forest()
    with Sdf.ChangeBlock():
        instancer.GetIdsAttr().Block()
        instancer.GetInvisibleIdsAttr().Set([])
        instancer.GetVelocitiesAttr().Clear()
        instancer.GetPositionsAttr().Set([(i * 0.5 - 2, 0, 0) for i in range(n)], 2)
        instancer.GetProtoIndicesAttr().Set([i % 2 for i in range(n)])
        instancer.GetOrientationsAttr().Set([Gf.Quath(1)] * n)
        instancer.GetScalesAttr().Set([(1, 1, 1)] * n)
        at("/Forest").GetAttribute("primvars:displayColor").Set([(1, 1, 1)] * n)

EDITS = {
    "hide_one": lambda: forest().GetInvisibleIdsAttr().Set([10]),
    "turn": lambda: edit(stage, "/Spins.orientations", [Gf.Quath(0, 0, 0, 1), Gf.Quath(1)], 2),
    "move_instancer": lambda: edit(stage, "/Forest.xformOp:translate", Gf.Vec3d(0, 1, 0), 3),
    "move_prototype": lambda: edit(
        stage, "/Forest/Prototypes/Inner/Ball.xformOp:scale", Gf.Vec3f(0.8)),
    "swap": lambda: forest().GetProtoIndicesAttr().Set([1, 0, 1, 0]),
    "inner_count": lambda: (inner().GetProtoIndicesAttr().Set([0, 0, 0]),
                            inner().GetPositionsAttr().Clear(),
                            inner().GetPositionsAttr().Set([(0, 0, 0), (0, 1, 0), (1, 1, 0)])),
    "more": lambda: count(7),
    "fewer": lambda: count(3),
    "none": lambda: count(0),
    "some": lambda: count(5),
    "hide_instancer": lambda: UsdGeom.Imageable(at("/Forest")).MakeInvisible(),
    "show_instancer": lambda: UsdGeom.Imageable(at("/Forest")).MakeVisible(),
    "no_prototype": lambda: forest().GetPrototypesRel().SetTargets(["/Forest/Prototypes/Pair"]),
    "native_move": lambda: edit(stage, "/Left.xformOp:translate", Gf.Vec3d(-2, 1, 0)),
    "native_new": lambda: add_native(),
    "native_source": lambda: edit(stage, "/_pair/A.xformOp:scale", Gf.Vec3f(0.5)),
    "native_gone": lambda: at("/Left").SetActive(False),
    "uninstance": lambda: at("/Right").SetInstanceable(False),
    "remove_instancer": lambda: stage.RemovePrim("/Forest"),
}

def add_native():
    prim = stage.DefinePrim("/Top", "Xform")
    prim.GetInherits().AddInherit("/_pair")
    prim.SetInstanceable(True)
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0, 1.5, 0))
"""

SHAPES = """
def add():
    patch = UsdGeom.NurbsPatch.Define(stage, "/Patch")
    line = UsdGeom.NurbsCurves.Define(stage, "/Line")
    UsdGeom.Plane.Define(stage, "/Plane").AddTranslateOp().Set(Gf.Vec3d(0, -3, 1))
    change("/Patch", uOrder=3, vOrder=2, uVertexCount=4, vVertexCount=2,
           uKnots=[0, 0, 0, 1, 2, 2, 2], vKnots=[0, 0, 1, 1],
           points=[(u - 2, 2 * v, u * v % 3) for v in range(2) for u in range(4)])
    change("/Line", curveVertexCounts=[5], order=[3], knots=[0, 0, 0, 1, 2, 3, 3, 3],
           points=[(x - 2, x % 2 - 1, 2) for x in range(5)], widths=[0.3])

def change(path, **values):
    with Sdf.ChangeBlock():
        for name, value in values.items():
            edit(stage, f"{path}.{name}", value)

EDITS = {
    "add": add,
    "patch_order": lambda: change("/Patch", uOrder=2, uKnots=[0, 0, 1, 2, 3, 3]),
    "patch_knots": lambda: change("/Patch", uOrder=3, uKnots=[0, 0, 0, 0.5, 2, 2, 2]),
    "patch_range": lambda: change("/Patch", uRange=Gf.Vec2d(0.2, 1.5)),
    "patch_count": lambda: change("/Patch", vVertexCount=1),
    "patch_counts": lambda: change("/Patch", vVertexCount=2),
    "line_order": lambda: change("/Line", order=[2], knots=[0, 0, 1, 2, 3, 4, 4]),
    "line_counts": lambda: change("/Line", curveVertexCounts=[4], knots=[0, 0, 1, 2, 3, 3]),
    "line_range": lambda: change("/Line", ranges=[Gf.Vec2d(0.5, 2)]),
    "plane_width": lambda: change("/Plane", width=1.0),
    "plane_axis": lambda: change("/Plane", axis="Y"),
}
"""


@pytest.mark.parametrize(("scene", "edits"), [("motion", MOTION), ("instances", INSTANCES)])
def test_each_edit_shows(host, scene, edits):
    left_out = () if host.scene_index else UNTOLD
    check_each(host, 17, edits, scene=SCENES / f"{scene}.usda", left_out=left_out)


def test_each_edit_of_a_shape_of_its_own_shows(index_host):
    """Scene delegates make meshes of these."""
    check_each(index_host, 11, SHAPES, scene=SCENES / "motion.usda", left_out=())


def check_each(host, count, edits, **given):
    ran = host.run(edits + COMPARE, **given)
    before = None
    assert len(ran.told["done"]) >= count
    for name in ran.told["done"]:
        seen, fresh = (read_exr(ran.folder / f"{name}.{view}.exr") for view in ("seen", "fresh"))
        now, new = (np.stack([image[c] for c in "RGBA"]) for image in (seen, fresh))
        np.testing.assert_array_equal(now, new, err_msg=name)
        if before is not None:
            assert np.array_equal(now, before) == (name in UNSEEN), f"{name} shows nothing"
        before = now


WHILE_RENDERING = """
import random, threading

stage = Usd.Stage.Open(scene)
view = View(stage, "/main_cam", interactive=False, samples=1_000_000)
turn = threading.Lock()
errors = []

def work(seed):
    chance = random.Random(seed)
    paths = ["/Moves.xformOp:translate", "/Slowed.xformOp:translate", "/main_cam.xformOp:translate"]
    try:
        for _ in range(15):
            with turn:
                path = chance.choice(paths)
                edit(stage, path, Gf.Vec3d(chance.random(), chance.random(), 12 * ("cam" in path)))
                UsdGeom.Imageable(stage.GetPrimAtPath("/Deforms")).GetVisibilityAttr().Set(
                    chance.choice(["inherited", "invisible"]))
                stage.GetPrimAtPath("/Flies").SetActive(chance.random() < 0.5)
            time.sleep(chance.random() * 0.01)
            with turn:
                assert not view.draw(2)
                view.stats()
    except BaseException as error:
        errors.append(repr(error))

threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
view.set(samples=4)
view.render(2)
view.save("seen.exr")
fresh = View(stage, "/main_cam", interactive=False, samples=4)
fresh.render(2)
fresh.save("fresh.exr")
tell(errors=errors)
"""


def test_edits_of_several_threads_while_it_renders(host):
    """A stage is edited and drawn by one thread at a time; the renderer's own go on meanwhile."""
    ran = host.run(WHILE_RENDERING, scene=SCENES / "motion.usda")
    assert ran.told["errors"] == []
    assert ran.warnings == []
    seen, fresh = (read_exr(ran.folder / f"{view}.exr") for view in ("seen", "fresh"))
    for channel in fresh.keys() - {"primId.X"}:  # hosts give those anew
        np.testing.assert_array_equal(seen[channel], fresh[channel])
