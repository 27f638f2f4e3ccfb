"""GeomSubsets: the AOV subsetId, what is said about faulty ones, and subsets that change."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from hdtrapeze.cli import main
from images import read_exr
from pxr import Gf, Sdf, UsdGeom
from scenes import add_camera, add_grid, add_quad, new_stage, one_warning, pixel, render

AOVS = ("color", "elementId", "subsetId")


def add_subset(mesh, name, indices, family="materialBind", element="face"):
    """A subset of the mesh; the family type is left alone."""
    subset = UsdGeom.Subset.Define(mesh.GetPrim().GetStage(), mesh.GetPath().AppendChild(name))
    subset.CreateElementTypeAttr(element)
    subset.CreateFamilyNameAttr(family)
    if indices is not None:
        subset.CreateIndicesAttr(indices)
    return subset


def grid_stage(n=2, scheme="none"):
    """The standard camera and a grid of n x n faces."""
    stage = new_stage()
    add_camera(stage)
    return stage, add_grid(stage, n=n, scheme=scheme)


def numbers(image):
    """{face: number of its subset}, the same in each of its pixels."""
    faces, subsets = image["elementId"], image["subsetId"]
    found = {}
    for face in np.unique(faces):
        values = np.unique(subsets[faces == face])
        assert len(values) == 1, (face, values)
        found[int(face)] = int(values[0])
    return found


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_each_face_shows_its_subset(scheme):
    stage, mesh = grid_stage(3, scheme)
    add_subset(mesh, "corners", [0, 2, 6, 8])
    add_subset(mesh, "middle", [4])
    add_subset(mesh, "elsewhere", [1, 3], family="shading")
    image = render(stage, aovs=AOVS)
    expected = dict.fromkeys(range(-1, 9), -1) | {0: 0, 2: 0, 6: 0, 8: 0, 4: 1}
    assert numbers(image) == expected
    assert not image.warnings


def test_without_materials_the_first_family_counts_and_without_subsets_none():
    stage, mesh = grid_stage()
    assert set(numbers(render(stage, aovs=AOVS)).values()) == {-1}
    add_subset(mesh, "a", [1], family="")
    add_subset(mesh, "b", [1, 2], family="")
    add_subset(mesh, "c", [0, 3], family="other")
    assert numbers(render(stage, aovs=AOVS)) == {-1: -1, 0: -1, 1: 0, 2: 1, 3: -1}


def test_instances_have_the_subsets_of_their_mesh():
    stage = new_stage()
    add_camera(stage)
    mesh = add_grid(stage, "/proto/grid")
    add_subset(mesh, "low", [0, 1])
    add_subset(mesh, "high", [2, 3])
    add_subset(mesh, "bad", [9])
    stage.OverridePrim("/proto").SetSpecifier(Sdf.SpecifierClass)
    for name, x in (("/left", -2.5), ("/right", 2.5)):
        instance = UsdGeom.Xform.Define(stage, name)
        instance.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        instance.GetPrim().GetReferences().AddInternalReference("/proto")
        instance.GetPrim().SetInstanceable(True)
    image = render(stage, aovs=AOVS)
    for x in (-2.5, 2.5):
        assert image["subsetId"][pixel(x, -1)] == 0
        assert image["subsetId"][pixel(x, 1)] == 1
    one_warning(image, "/left/grid/bad", "1 of 1 indices")


@pytest.mark.parametrize(
    ("family_type", "indices", "path", "words"),
    [
        ("unrestricted", ([0, 1, 4], [2]), "/grid/a", "1 of 3 indices are not among the 4 faces"),
        ("unrestricted", ([0, 1], [-1, 2]), "/grid/b", "1 of 2 indices are not among"),
        ("unrestricted", ([0, 1, 0], [2]), "/grid/a", "1 of 3 indices are there before"),
        ("nonOverlapping", ([0, 1], [1, 2]), "/grid/b", "other subsets of its family materialBind"),
        ("partition", ([0, 1], [2]), "/grid/a", "1 of 4 faces are in none"),
    ],
)
def test_faults_are_told_once_and_the_rest_renders(family_type, indices, path, words):
    stage, mesh = grid_stage()
    UsdGeom.Subset.SetFamilyType(mesh, "materialBind", family_type)
    for name, values in zip("ab", indices, strict=True):
        add_subset(mesh, name, values)
    image = render(stage, aovs=AOVS)
    one_warning(image, path, words)
    assert numbers(image) == {-1: -1, 0: 0, 1: 0, 2: 1, 3: -1}


def test_overlaps_are_fine_where_nothing_forbids_them():
    stage, mesh = grid_stage()
    add_subset(mesh, "a", [0, 1])
    add_subset(mesh, "b", [1, 2, 3])
    image = render(stage, aovs=AOVS)
    assert not image.warnings
    assert numbers(image) == {-1: -1, 0: 0, 1: 0, 2: 1, 3: 1}


def test_wrong_tokens_and_types():
    stage, mesh = grid_stage()
    add_subset(mesh, "a", [0], element="fase")
    family = mesh.GetPrim().CreateAttribute(
        "subsetFamily:materialBind:familyType", Sdf.ValueTypeNames.Token
    )
    family.Set("parts")
    image = render(stage, aovs=AOVS)
    assert {w[0] for w in image.warnings} == {"/grid", "/grid/a"}
    text = " ".join(w[2] for w in image.warnings)
    assert "'fase'" in text and "face is used" in text and "'parts'" in text
    assert numbers(image)[0] == 0

    stage, mesh = grid_stage()
    stage.DefinePrim("/grid/bad", "GeomSubset")
    spec = stage.GetRootLayer().GetPrimAtPath("/grid/bad")
    Sdf.AttributeSpec(spec, "indices", Sdf.ValueTypeNames.FloatArray).default = [0.5]
    add_subset(mesh, "good", [1])
    image = render(stage, aovs=AOVS)
    one_warning(image, "/grid/bad", "has the type", "this subset is ignored")
    assert image.alpha.max() == 1
    assert numbers(image)[1] == 0


@pytest.mark.parametrize("element", ["point", "edge", "tetrahedron", "segment"])
def test_only_subsets_of_faces_are_used(element):
    stage, mesh = grid_stage()
    plural = {"tetrahedron": "tetrahedra"}.get(element, f"{element}s")
    add_subset(mesh, "other", [0, 1], element=element)
    add_subset(mesh, "faces", [1])
    image = render(stage, aovs=AOVS)
    one_warning(image, "/grid/other", f"a subset of {plural} is not used")
    assert numbers(image)[1] == 1


def test_subsets_of_other_prims_are_told():
    stage = new_stage()
    add_camera(stage)
    curves = UsdGeom.BasisCurves.Define(stage, "/curves")
    curves.CreateTypeAttr("linear")
    curves.CreatePointsAttr([(-1, 0, 0), (1, 0, 0)])
    curves.CreateCurveVertexCountsAttr([2])
    add_subset(curves, "a", [0, 0], element="segment")
    add_subset(curves, "b", [0, 0], element="segment")
    image = render(stage, aovs=AOVS)
    one_warning(image, "/curves", "2 GeomSubsets", "only those of a Mesh")
    assert image["subsetId"].max() == -1


def test_indices_that_change_are_those_of_the_frame_and_edits_are_seen():
    stage, mesh = grid_stage()
    subset = add_subset(mesh, "a", None)
    subset.GetIndicesAttr().Set([0], 1)
    subset.GetIndicesAttr().Set([1, 2], 2)
    options = Options(width=20, height=20, samples=1, aovs=list(AOVS), camera="/camera")
    with Renderer(options) as renderer:

        def at(frame):
            renderer.load(stage, frame)
            renderer.render()
            image = {name: renderer.aov(name) for name in AOVS}
            return {face for face, number in numbers(image).items() if number == 0}

        assert [at(frame) for frame in (1, 2, 1.5)] == [{0}, {1, 2}, {0}]
        stage.RemovePrim("/grid/a")
        assert at(1) == set()


def test_the_aov_in_a_file(tmp_path):
    stage, mesh = grid_stage()
    add_subset(mesh, "a", [0, 1, 2])
    scene, out = str(tmp_path / "scene.usda"), tmp_path / "shot.exr"
    stage.GetRootLayer().Export(scene)
    flags = ["--imageWidth", "20", "--samples", "1", "--camera", "/camera", "--aov", "subsetId"]
    assert main(["record", "-q", *flags, scene, str(out)]) == 0
    ids = read_exr(out)["subsetId.X"].view(np.int32)
    assert [ids[at] for at in (pixel(x, y, size=20) for x, y in ((-1, -1), (1, 1)))] == [0, -1]


def test_pictures_without_the_aov_are_the_same():
    stage, mesh = grid_stage()
    add_quad(stage, "/other", z=-1)
    before = render(stage, aovs=("color", "elementId"))
    add_subset(mesh, "a", [0, 1, 2])
    after = render(stage, aovs=AOVS)
    for name in ("color", "elementId"):
        np.testing.assert_array_equal(before[name], after[name])
