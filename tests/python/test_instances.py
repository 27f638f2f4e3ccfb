"""Instances look like the same meshes written out, moving or not."""

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom, Vt
from scenes import add_camera, add_cube, add_quad, new_stage, pixel, render, set_samples

IDS = ("color", "primId", "instanceId", "elementId", "P")
PLACES = (Gf.Vec3d(-2.5, -2, 0), Gf.Vec3d(2.5, -2, 0), Gf.Vec3d(0, 2, 1))


def native(instanceable, moving=False, color=None):
    stage = new_stage()
    add_camera(stage)
    stage.CreateClassPrim("/prototype")
    add_cube(stage, "/prototype/cube", half=1.0, scheme="catmullClark")
    UsdGeom.Xformable.Get(stage, "/prototype/cube").AddRotateYOp().Set(30.0)
    if moving:
        spin = UsdGeom.Xformable.Get(stage, "/prototype/cube").AddRotateZOp()
        set_samples(spin.GetAttr(), {0: 0.0, 1: 50.0})
    for i, place in enumerate(PLACES):
        xform = UsdGeom.Xform.Define(stage, f"/copy{i}")
        op = xform.AddTranslateOp()
        op.Set(place)
        if moving:
            set_samples(op.GetAttr(), {0: place, 1: place + Gf.Vec3d(0.5 * i, 1, 0)})
        xform.GetPrim().GetReferences().AddInternalReference("/prototype")
        xform.GetPrim().SetInstanceable(instanceable)
        if color and i == 1:
            primvars = UsdGeom.PrimvarsAPI(xform)
            primvar = primvars.CreatePrimvar(
                "displayColor", Sdf.ValueTypeNames.Color3fArray, "constant"
            )
            primvar.Set(Vt.Vec3fArray([Gf.Vec3f(*color)]))
    return stage


@pytest.mark.parametrize("moving", [False, True])
def test_native_instances(moving):
    # Shared and written out they are diced at different rates, so at fine ones.
    settings = {"aovs": IDS, "samples": 64, "shading_rate": 0.25}
    settings["shutter"] = (0, 1) if moving else None
    shared = render(native(True, moving), **settings)
    flat = render(native(False, moving), **settings)
    assert shared.statistics["instances"] >= 3
    np.testing.assert_allclose(shared["color"], flat["color"], atol=0.06)
    difference = np.sqrt(np.mean((shared["color"] - flat["color"]) ** 2))
    assert difference < 0.006
    hit = shared["primId"] >= 0
    assert set(np.unique(shared["primId"][hit])) == {0}
    assert set(np.unique(shared["instanceId"][hit])) == {0, 1, 2}
    assert set(np.unique(flat["primId"][flat["primId"] >= 0])) == {0, 1, 2}


def test_inherited_color_differs_between_instances():
    image = render(native(True, color=(1, 0, 0)))
    red, gray = image["color"][pixel(2.5, -2)], image["color"][pixel(-2.5, -2)]
    assert red[0] > 2 * gray[0]
    assert red[1] == 0
    assert gray[1] > 0


def test_nested_native_instances():
    stage = new_stage()
    add_camera(stage)
    stage.CreateClassPrim("/inner")
    add_quad(stage, "/inner/quad", -0.5, -0.5, 0.5, 0.5)
    stage.CreateClassPrim("/outer")
    for i, x in enumerate((-1, 1)):
        xform = UsdGeom.Xform.Define(stage, f"/outer/part{i}")
        xform.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/inner")
        xform.GetPrim().SetInstanceable(True)
    for i, y in enumerate((-2, 2)):
        xform = UsdGeom.Xform.Define(stage, f"/world{i}")
        xform.AddTranslateOp().Set(Gf.Vec3d(0, y, 0))
        xform.GetPrim().GetReferences().AddInternalReference("/outer")
        xform.GetPrim().SetInstanceable(True)
    image = render(stage, aovs=IDS)
    for x in (-1, 1):
        for y in (-2, 2):
            assert image["primId"][pixel(x + 0.1, y + 0.1)] == 0
    assert set(np.unique(image["instanceId"])) == {-1, 0, 1, 2, 3}
    assert image.alpha.sum() == 4 * 16


def point_instancer(stage, path="/instancer", prototype="quad"):
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    add_quad(stage, f"{path}/{prototype}", -0.5, -0.5, 0.5, 0.5)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(f"{path}/{prototype}")])
    return instancer


def test_point_instancer():
    stage = new_stage()
    add_camera(stage)
    instancer = point_instancer(stage)
    instancer.CreateProtoIndicesAttr([0, 0, 0, 0])
    instancer.CreatePositionsAttr([(-3, 0, 0), (0, 0, 0), (3, 0, 0), (0, 3, 0)])
    instancer.CreateScalesAttr([(1, 1, 1), (2, 1, 1), (1, 3, 1), (1, 1, 1)])
    instancer.CreateInvisibleIdsAttr([3])
    UsdGeom.Xformable(instancer).AddTranslateOp().Set(Gf.Vec3d(0, -1, 0))
    image = render(stage, aovs=IDS)
    assert image.alpha.sum() == 16 + 32 + 48
    for instance, x in ((0, -3), (1, 0), (2, 3)):
        assert image["instanceId"][pixel(x + 0.1, -0.9)] == instance
    assert image["primId"][pixel(0.1, 2.1)] == -1
    assert image.warnings == []


def test_prototypes_own_transform_and_several_prototypes():
    stage = new_stage()
    add_camera(stage)
    instancer = point_instancer(stage)
    UsdGeom.Xformable.Get(stage, "/instancer/quad").AddScaleOp().Set(Gf.Vec3f(2, 1, 1))
    add_quad(stage, "/instancer/other", -0.25, -0.25, 0.25, 0.25)
    instancer.GetPrototypesRel().AddTarget("/instancer/other")
    instancer.CreateProtoIndicesAttr([0, 1])
    instancer.CreatePositionsAttr([(-2, 0, 0), (2, 0, 0)])
    image = render(stage, aovs=IDS)
    assert image.alpha.sum() == 32 + 4
    assert image["instanceId"][pixel(2.1, 0.1)] == 1


def test_moving_point_instances_match_moving_meshes():
    stage = new_stage()
    add_camera(stage)
    instancer = point_instancer(stage)
    instancer.CreateProtoIndicesAttr([0, 0])
    set_samples(
        instancer.CreatePositionsAttr(),
        {
            0: Vt.Vec3fArray([(-3, 0, 0), (2, 0, 0)]),
            1: Vt.Vec3fArray([(-1, 1, 0), (2, 2, 0)]),
        },
    )
    flat = new_stage()
    add_camera(flat)
    for i, (a, b) in enumerate((((-3, 0, 0), (-1, 1, 0)), ((2, 0, 0), (2, 2, 0)))):
        quad = add_quad(flat, f"/quad{i}", -0.5, -0.5, 0.5, 0.5)
        set_samples(quad.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(*a), 1: Gf.Vec3d(*b)})
    settings = {"shutter": (0, 1), "samples": 64}
    np.testing.assert_allclose(
        render(stage, **settings).alpha, render(flat, **settings).alpha, atol=0.02
    )


def test_velocities_of_point_instances():
    stage = new_stage()
    add_camera(stage)
    instancer = point_instancer(stage)
    instancer.CreateProtoIndicesAttr([0])
    # Velocities move time samples; units a second, 24 time codes a second.
    instancer.CreatePositionsAttr().Set([(-2, 0, 0)], 0)
    instancer.CreateVelocitiesAttr().Set([(96, 0, 0)], 0)
    alpha = render(stage, shutter=(0, 1), samples=64).alpha
    columns = np.flatnonzero(alpha[20])
    assert columns.min() == 10
    assert columns.max() == 29
    assert alpha.sum() == pytest.approx(16, rel=0.02)


def test_nested_point_instancers():
    stage = new_stage()
    add_camera(stage)
    inner = point_instancer(stage, "/inner")
    inner.CreateProtoIndicesAttr([0, 0])
    inner.CreatePositionsAttr([(-1, 0, 0), (1, 0, 0)])
    outer = UsdGeom.PointInstancer.Define(stage, "/outer")
    outer.CreatePrototypesRel().SetTargets([Sdf.Path("/inner")])
    outer.CreateProtoIndicesAttr([0, 0])
    outer.CreatePositionsAttr([(0, -3, 0), (0, 3, 0)])
    image = render(stage, aovs=IDS)
    # Twice through the outer one, and once where the inner one stands itself.
    assert image.alpha.sum() == 6 * 16
    for y in (-3, 0, 3):
        for x in (-1, 1):
            assert image["primId"][pixel(x + 0.1, y + 0.1)] >= 0


def test_point_instances_of_a_moving_instancer():
    stage = new_stage()
    add_camera(stage)
    instancer = point_instancer(stage)
    instancer.CreateProtoIndicesAttr([0])
    instancer.CreatePositionsAttr([(0, 0, 0)])
    op = UsdGeom.Xformable(instancer).AddTranslateOp()
    set_samples(op.GetAttr(), {0: Gf.Vec3d(-2, 0, 0), 1: Gf.Vec3d(2, 0, 0)})
    alpha = render(stage, shutter=(0, 1), samples=64).alpha
    columns = np.flatnonzero(alpha[20])
    assert (columns.min(), columns.max()) == (10, 29)


def test_wrong_point_instancers_give_one_warning():
    stage = new_stage()
    add_camera(stage)
    add_quad(stage, x0=3, y0=3, x1=4, y1=4)
    instancer = point_instancer(stage)
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0)])
    image = render(stage)
    assert [w[0] for w in image.warnings] == ["/instancer"]
    assert image.alpha.sum() == 16
    instancer.GetProtoIndicesAttr().Set([0, 5, -1])
    instancer.GetPositionsAttr().Set([(0, 0, 0), (1, 0, 0), (2, 0, 0)])
    image = render(stage)
    assert [w[0] for w in image.warnings] == ["/instancer"]
    assert image.alpha.sum() == 32


@pytest.mark.parametrize("specifier", [Sdf.SpecifierOver, Sdf.SpecifierClass])
def test_prototypes_below_an_over_or_a_class(specifier):
    stage = new_stage()
    add_camera(stage)
    instancer = UsdGeom.PointInstancer.Define(stage, "/instancer")
    add_quad(stage, "/library/quad", -0.5, -0.5, 0.5, 0.5)
    stage.GetPrimAtPath("/library").SetSpecifier(specifier)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path("/library")])
    instancer.CreateProtoIndicesAttr([0])
    instancer.CreatePositionsAttr([(2, 2, 0)])
    image = render(stage)
    assert image.alpha.sum() == 16
    assert image.alpha[pixel(2.1, 2.1)] == 1
