"""doubleSided, orientation and culled sides, from the stage to the image."""

import numpy as np
import pytest
from hdtrapeze.cli import main
from images import read_exr
from pxr import Gf, UsdGeom
from scenes import add_camera, add_cube, add_quad, new_stage, pixel, render

AOVS = ("color", "cameraDepth", "normal", "Neye", "primId")
MIDDLE = pixel(0.1, 0.1)


def square(stage, path="/quad", turned=False, **attributes):
    """A square in the middle that shows the camera its front, or `turned` its back."""
    mesh = add_quad(stage, path)
    if turned:
        mesh.AddRotateXOp().Set(180.0)
    for name, value in attributes.items():
        mesh.GetPrim().GetAttribute(name).Set(value)
    return mesh


def test_normals_are_those_of_the_side_seen_where_both_are_outsides():
    for scheme in ("none", "catmullClark"):
        for turned, double_sided, z in (
            (False, False, 1),
            (False, True, 1),
            (True, False, -1),
            (True, True, 1),
        ):
            stage = new_stage()
            add_camera(stage)
            square(stage, turned=turned, doubleSided=double_sided, subdivisionScheme=scheme)
            image = render(stage, aovs=AOVS)
            for name in ("normal", "Neye"):
                np.testing.assert_allclose(image[name][MIDDLE], [0, 0, z], atol=1e-5)
            assert image["color"][MIDDLE][0] > 0.3, "lit on both sides"


def test_planes_are_double_sided_unless_they_say_otherwise():
    for double_sided, z, alpha in ((None, 1, 1), (False, -1, 0)):
        stage = new_stage()
        add_camera(stage)
        plane = UsdGeom.Plane.Define(stage, "/plane")
        plane.CreateOrientationAttr("leftHanded")
        if double_sided is not None:
            plane.CreateDoubleSidedAttr(double_sided)
        assert render(stage, aovs=AOVS)["normal"][MIDDLE][2] == pytest.approx(z)
        assert render(stage, cull="backUnlessDoubleSided").alpha[MIDDLE] == alpha


def test_authored_normals_on_the_wrong_side_are_turned_to_the_viewer():
    stage = new_stage()
    add_camera(stage)
    mesh = square(stage, doubleSided=True)
    mesh.CreateNormalsAttr([Gf.Vec3f(0.6, 0, -0.8)] * 4)
    image = render(stage, aovs=AOVS)
    np.testing.assert_allclose(image["normal"][MIDDLE], [-0.6, 0, 0.8], atol=1e-3)


@pytest.mark.parametrize(
    ("cull", "front", "back"),
    [
        ("none", True, True),
        ("back", True, False),
        ("front", False, True),
        ("backUnlessDoubleSided", True, False),
    ],
)
def test_culled_sides(cull, front, back):
    for attributes, turned in (({}, False), ({"orientation": "leftHanded"}, True)):
        for rotated in (False, True):
            stage = new_stage()
            add_camera(stage)
            square(stage, turned=rotated, **attributes)
            add_quad(stage, "/behind", -4, -4, 4, 4, z=-3.0)
            image = render(stage, aovs=AOVS, cull=cull)
            seen = back if rotated != turned else front
            # The wall behind shows its front, so it is culled only with fronts.
            hidden = not seen and cull == "front"
            depth = 10.0 if seen else 0.0 if hidden else 13.0
            assert image["cameraDepth"][MIDDLE] == pytest.approx(depth), (cull, attributes)


def test_double_sided_prims_are_seen_from_behind_unless_all_backs_are_culled():
    stage = new_stage()
    add_camera(stage)
    square(stage, turned=True, doubleSided=True)
    assert render(stage, cull="backUnlessDoubleSided").alpha[MIDDLE] == 1
    assert render(stage, cull="back").alpha[MIDDLE] == 0


@pytest.mark.parametrize("scheme", ["none", "bilinear", "catmullClark"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_subdivision_surfaces_are_closed_from_outside(scheme, mirrored):
    """Culling backs of a solid changes no bit; culling fronts shows its inside."""
    stage = new_stage()
    add_camera(stage)
    cube = add_cube(stage, scheme=scheme)
    cube.AddRotateXYZOp().Set(Gf.Vec3f(30, 40, 20))
    if mirrored:
        cube.AddScaleOp().Set(Gf.Vec3f(1, -1, 1))
    images = {cull: render(stage, aovs=AOVS, cull=cull) for cull in ("none", "back", "front")}
    for name in AOVS:
        np.testing.assert_array_equal(images["back"][name], images["none"][name])
    hit = images["front"]["primId"] == 0
    np.testing.assert_array_equal(hit, images["none"]["primId"] == 0)
    inside = images["front"]["cameraDepth"] - images["none"]["cameraDepth"]
    assert inside[hit].min() > -1e-5
    assert inside[MIDDLE] > 1.0


def test_transparent_layers_are_culled_too():
    """A sheet that shows its back lets all of the light through, one that shows its front half."""
    stage = new_stage()
    add_camera(stage)
    for i, turned in enumerate((True, False)):
        sheet = add_quad(stage, f"/sheet{i}", z=0.0)
        if turned:
            sheet.AddRotateXOp().Set(180.0)
        sheet.CreateDisplayOpacityAttr([0.5])
    assert render(stage).alpha[MIDDLE] == pytest.approx(0.75)
    assert render(stage, cull="back").alpha[MIDDLE] == pytest.approx(0.5)


def test_instances_that_are_mirrored_keep_their_outside():
    stage = new_stage()
    add_camera(stage)
    instancer = UsdGeom.PointInstancer.Define(stage, "/i")
    square(stage, "/i/quad")
    instancer.CreatePrototypesRel().SetTargets(["/i/quad"])
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr([Gf.Vec3f(x, 0, 0) for x in (-3, 0, 3)])
    instancer.CreateScalesAttr(
        [Gf.Vec3f(*s) for s in ((-0.5, 0.5, 1), (0.5, 0.5, -1), (0.5, 0.5, 1))]
    )
    alpha = render(stage, cull="back").alpha
    assert [alpha[pixel(x, 0.1)] for x in (-3, 0.1, 3)] == [1, 0, 1]


def test_the_flag_and_what_explains_it(tmp_path, capsys):
    stage = new_stage()
    add_camera(stage)
    square(stage, turned=True)
    scene = str(tmp_path / "scene.usda")
    stage.GetRootLayer().Export(scene)
    flags = ["--imageWidth", "20", "--samples", "1", "--camera", "/camera", "--explain"]

    def shot(*more):
        assert main(["record", "-q", *flags, *more, scene, str(tmp_path / "shot.exr")]) == 0
        return read_exr(tmp_path / "shot.exr")["A"].max(), capsys.readouterr().out

    alpha, told = shot()
    assert alpha == 1
    assert "culled" not in told
    alpha, told = shot("--cull", "back")
    assert alpha == 0
    assert "culled sides: some, called for by /quad" in told
