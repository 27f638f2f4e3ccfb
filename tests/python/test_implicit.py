"""Implicit prims against closed forms: silhouettes, depth, normals, extents, motion, instances."""

import numpy as np
import pytest
from oracle import agree, blurred, estimate, mean_over_times
from pxr import Gf, Sdf, Usd, UsdGeom
from scenes import DISTANCE, SIZE, VIEW, add_camera, new_stage, pixel, render, set_samples

AOVS = ("color", "depth", "cameraDepth", "P", "normal", "elementId")

SHAPES = {
    UsdGeom.Cube: {"size": 1.5},
    UsdGeom.Plane: {"width": 2.0, "length": 3.0},
    UsdGeom.Sphere: {"radius": 1.2},
    UsdGeom.Cylinder: {"height": 3.0, "radius": 0.8},
    UsdGeom.Cylinder_1: {"height": 3.0, "radiusBottom": 1.2, "radiusTop": 0.4},
    UsdGeom.Cone: {"height": 3.0, "radius": 1.1},
    UsdGeom.Capsule: {"height": 1.5, "radius": 0.7},
    UsdGeom.Capsule_1: {"height": 2.0, "radiusBottom": 1.2, "radiusTop": 0.5},
}


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage)
    return stage


def add(stage, kind, axis=None, path="/shape", **sizes):
    """An implicit prim with sizes of its own."""
    prim = kind.Define(stage, path)
    for name, size in (SHAPES[kind] | sizes).items():
        prim.GetPrim().GetAttribute(name).Set(size)
    if axis and hasattr(prim, "GetAxisAttr"):
        prim.GetAxisAttr().Set(axis)
    return prim


def rays(size=SIZE, splits=1):
    """Directions of the standard camera's rays through each pixel, `splits` squared of them."""
    steps = (np.arange(size * splits) + 0.5) / (size * splits) - 0.5
    x, y = np.meshgrid(steps * VIEW / DISTANCE, -steps * VIEW / DISTANCE)
    return np.stack([x, y, np.full_like(x, -1.0)], axis=-1)


def sphere_hits(radius, directions, centre=(0.0, 0.0, 0.0)):
    """Distance along rays from (0, 0, DISTANCE) to a sphere; NaN where they miss."""
    origin = np.array([0.0, 0.0, DISTANCE]) - centre
    a = (directions**2).sum(-1)
    b = (directions * origin).sum(-1)
    with np.errstate(invalid="ignore"):
        return (-b - np.sqrt(b * b - a * (origin @ origin - radius**2))) / a


def coverage(inside, splits):
    """Means over blocks of a supersampled mask."""
    size = len(inside) // splits
    return inside.reshape(size, splits, size, splits).mean(axis=(1, 3))


def test_the_silhouette_of_a_sphere_is_a_disc(stage):
    add(stage, UsdGeom.Sphere, radius=2.0)
    image = render(stage, samples=256, shading_rate=1.0)
    exact = coverage(~np.isnan(sphere_hits(2.0, rays(splits=16))), 16)
    # A chord of a pixel on a radius of 8 pixels misses the circle by 1/64 pixel.
    np.testing.assert_allclose(image.alpha, exact, atol=0.06)
    assert abs(image.alpha.sum() / exact.sum() - 1.0) < 0.005
    finer = render(stage, samples=256, shading_rate=0.25).alpha
    assert abs(finer.sum() / exact.sum() - 1.0) < 0.001


def test_depth_position_and_normals_of_a_sphere_are_exact(stage):
    add(stage, UsdGeom.Sphere, radius=2.0)
    image = render(stage, aovs=AOVS, shading_rate=0.25)
    directions = rays()
    t = sphere_hits(1.9, directions)  # well inside the silhouette
    inside = ~np.isnan(t)
    # The sample is somewhere in its pixel, so the depth is that at the position that it saw.
    seen = image["P"][inside]
    assert np.abs(np.linalg.norm(seen, axis=-1) - 2.0).max() < 2e-3
    np.testing.assert_allclose(image["cameraDepth"][inside], DISTANCE - seen[:, 2], atol=1e-4)
    centre = sphere_hits(2.0, directions)[inside]
    slope = np.abs(centre - image["cameraDepth"][inside])
    assert np.median(slope) < 0.1  # and the position lies within the pixel
    normals = image["normal"][inside]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=0.02)
    # The mean of four samples of the pixel, against the one sample's place.
    assert (np.sum(normals * seen / 2.0, axis=-1) > 0.97).all()
    assert set(np.unique(image["elementId"])) == {-1, 0}


CUBE_SIDES = ((0, 0, 1), (0, 0, -1), (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0))


def test_a_cube_has_a_value_for_each_face_of_hydras_mesh(stage):
    cube = UsdGeom.Cube.Define(stage, "/shape")
    cube.CreateSizeAttr(4.0)
    sides = [UsdGeom.Xformable(cube).AddRotateXYZOp().GetAttr()]
    primvar = cube.CreateDisplayColorPrimvar("uniform")
    primvar.Set([tuple((np.array(side) + 1) / 2) for side in CUBE_SIDES])
    # Each side in turn to the camera.
    turns = ((0, 0, 0), (180, 0, 0), (90, 0, 0), (-90, 0, 0), (0, -90, 0), (0, 90, 0))
    for face, (side, turn) in enumerate(zip(CUBE_SIDES, turns, strict=True)):
        sides[0].Set(turn)
        image = render(stage, aovs=(*AOVS, "primvars:displayColor"))
        at = pixel(0.1, 0.1)
        assert image["elementId"][at] == face
        color = image["primvars:displayColor"][at]
        np.testing.assert_allclose(color, (np.array(side) + 1) / 2, atol=1e-6)
    assert image.warnings == []


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("interpolation", ["vertex", "varying", "faceVarying"])
@pytest.mark.parametrize("kind", [UsdGeom.Cube, UsdGeom.Plane])
def test_values_at_corners_are_those_of_hydras_mesh(stage, kind, interpolation, axis):
    shape = kind.Define(stage, "/shape")
    if kind is UsdGeom.Cube:
        shape.CreateSizeAttr(4.0)
        signs = "+++ -++ --+ +-+ --- -+- ++- +--"
        faces = (0, 1, 2, 3), (4, 5, 6, 7), (0, 6, 5, 1), (4, 7, 3, 2), (0, 3, 7, 6), (4, 2, 1, 5)
    else:
        shape.CreateWidthAttr(4.0)
        shape.CreateLengthAttr(3.0)
        shape.CreateAxisAttr(axis)
        signs = {"X": "0++ 0-+ 0-- 0+-", "Y": "-0+ +0+ +0- -0-", "Z": "++0 -+0 --0 +-0"}[axis]
        faces = ((0, 1, 2, 3),)
    corners = np.array([["-0+".index(c) - 1 for c in corner] for corner in signs.split()])
    if interpolation == "faceVarying":
        corners = corners[np.concatenate(faces)]
    primvar = UsdGeom.PrimvarsAPI(shape).CreatePrimvar(
        "place", Sdf.ValueTypeNames.Float3Array, interpolation
    )
    primvar.Set([Gf.Vec3f(*map(float, corner)) for corner in corners])
    turn = {"X": (0, -90, 0), "Y": (90, 0, 0), "Z": (0, 0, 0)}[axis]
    UsdGeom.Xformable(shape).AddRotateXYZOp().Set(turn)
    image = render(stage, aovs=("P", "elementId", "primvars:place"), samples=1)
    hit = image["elementId"] >= 0
    assert hit.mean() > 0.05
    to_shape = np.linalg.inv(np.array(shape.ComputeLocalToWorldTransform(0)))[:3, :3]
    place = image["P"][hit] @ to_shape
    size = 2.0 if kind is UsdGeom.Cube else np.where(_along_width(axis), 2.0, 1.5)
    np.testing.assert_allclose(image["primvars:place"][hit], place / size, atol=1e-4)
    assert image.warnings == []


def _along_width(axis):
    """Which coordinates of a plane run along its width."""
    return np.array({"X": (0, 0, 1), "Y": (1, 0, 0), "Z": (1, 0, 0)}[axis], dtype=bool)


def test_each_pixel_of_one_sample_has_the_normal_of_its_place(stage):
    for kind in (UsdGeom.Sphere, UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule_1):
        shape = add(stage, kind, axis="Y")
        image = render(stage, aovs=AOVS, samples=1, shading_rate=0.25)
        hit = image["elementId"] == 0
        place, normal = image["P"][hit], image["normal"][hit]
        radial = place[:, [0, 2]] / np.linalg.norm(place[:, [0, 2]], axis=-1, keepdims=True)
        sizes = SHAPES[kind]
        if kind is UsdGeom.Sphere:
            exact = place / 1.2
        elif kind is UsdGeom.Capsule_1:
            slope = (1.2 - 0.5) / 2.0
            stretch = np.hypot(slope, 1.0)
            along = place[:, 1]
            up = np.full(len(place), slope / stretch)
            for rim, radius, beyond in ((-1.0, 1.2, along < -1.0), (1.0, 0.5, along > 1.0)):
                up = np.where(beyond, (along - rim + radius * slope) / (radius * stretch), up)
            level = np.sqrt(np.maximum(0, 1 - up**2))
            exact = np.stack([radial[:, 0] * level, up, radial[:, 1] * level], axis=-1)
        else:
            top = 0.0 if kind is UsdGeom.Cone else sizes["radius"]
            slant = np.array([sizes["height"], sizes["radius"] - top])
            level, up = slant / np.linalg.norm(slant)
            exact = np.stack(
                [radial[:, 0] * level, np.full(len(place), up), radial[:, 1] * level], axis=-1
            )
        # The cap that the perspective shows is flat.
        if kind in (UsdGeom.Cylinder, UsdGeom.Cone):
            flat = np.abs(np.abs(place[:, 1]) - 0.5 * sizes["height"]) < 1e-4
            exact[flat] = [0, 1, 0] * np.sign(place[flat, 1:2])
        off = np.linalg.norm(normal - exact, axis=-1)
        assert np.quantile(off, 0.97) < 0.02, (kind, np.sort(off)[-10:])
        stage.RemovePrim(shape.GetPath())


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_extents_are_usds(stage, kind, axis):
    shape = add(stage, kind, axis)
    expected = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(shape, Usd.TimeCode.Default()))
    # Look along each axis with an orthographic camera: 90 pixels for 6 units.
    size, view = 90, 6.0
    for name, right, up in (("X", 1, 2), ("Y", 2, 0), ("Z", 0, 1)):
        camera = UsdGeom.Camera.Define(stage, "/side")
        camera.CreateProjectionAttr("orthographic")
        for aperture in (camera.CreateHorizontalApertureAttr, camera.CreateVerticalApertureAttr):
            aperture(view * 10)
        rows = np.eye(4)
        forward = np.eye(3)["XYZ".index(name)]
        rows[:3, :3] = [np.eye(3)[right], np.eye(3)[up], forward]
        rows[3, :3] = forward * 10.0
        camera.MakeMatrixXform().Set(Gf.Matrix4d(rows))
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 100))
        alpha = render(stage, camera="/side", width=size, height=size, samples=16).alpha
        stage.RemovePrim("/side")
        seen = alpha > 0
        flat = (expected[1] - expected[0])[[right, up]].min() == 0
        assert seen.any() != flat
        if flat:
            continue
        for pixels, axis_of in ((seen.any(axis=0), right), (seen.any(axis=1)[::-1], up)):
            where = np.flatnonzero(pixels)
            low, high = where[0] / size * view - view / 2, (where[-1] + 1) / size * view - view / 2
            assert abs(low - expected[0][axis_of]) < 1.1 * view / size
            assert abs(high - expected[1][axis_of]) < 1.1 * view / size


def test_what_tapers_does_so_up_its_axis(stage):
    for kind in (UsdGeom.Cone, UsdGeom.Cylinder_1, UsdGeom.Capsule_1):
        shape = add(stage, kind, axis="Y")
        wide = (render(stage).alpha > 0).sum(axis=1)
        assert wide[pixel(0, 1.0)[0]] < wide[pixel(0, -1.0)[0]]
        stage.RemovePrim(shape.GetPath())


def test_left_handed_turns_normals_in(stage):
    for kind in SHAPES:
        shape = add(stage, kind)
        # A Plane is double-sided unless it says otherwise.
        shape.CreateDoubleSidedAttr(False)
        out = render(stage, aovs=AOVS)["normal"][pixel(0.1, 0.1)]
        shape.CreateOrientationAttr("leftHanded")
        inward = render(stage, aovs=AOVS)["normal"][pixel(0.1, 0.1)]
        np.testing.assert_allclose(inward, -out, atol=1e-6)
        assert out[2] > 0.3
        stage.RemovePrim(shape.GetPath())


def test_a_growing_sphere_blurs_as_the_mean_of_its_moments(stage):
    sphere = add(stage, UsdGeom.Sphere)
    sphere.CreateDisplayColorAttr([Gf.Vec3f(0.9, 0.5, 0.2)])
    set_samples(sphere.GetRadiusAttr(), {0: 0.5, 0.5: 1.0, 1: 2.5})
    # Chords of a pixel would make the moments at which it is small smaller still.
    mean = mean_over_times(stage, shading_rate=0.25)
    same, figures = agree(blurred(stage, shutter=(0, 1), shading_rate=0.25), mean)
    assert same, figures
    still, figures = agree(blurred(stage, shutter=(1, 1), shading_rate=0.25), mean)
    assert not still, figures


def test_a_leaning_capsule_that_moves_and_turns_blurs_as_the_mean(stage):
    capsule = add(stage, UsdGeom.Capsule_1, axis="X")
    capsule.CreateDisplayColorAttr([Gf.Vec3f(0.2, 0.6, 0.9)])
    set_samples(capsule.GetRadiusBottomAttr(), {0: 0.2, 1: 1.5})
    set_samples(capsule.GetHeightAttr(), {0: 3.0, 1: 2.0})
    set_samples(capsule.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(-1), 1: Gf.Vec3d(1, 1, 0)})
    set_samples(capsule.AddRotateZOp().GetAttr(), {0: 0.0, 1: 60.0})
    same, figures = agree(blurred(stage, shutter=(0, 1)), mean_over_times(stage))
    assert same, figures


def test_instances_of_a_sphere_are_spheres(stage):
    places = [Gf.Vec3d(-2, 1, 0), Gf.Vec3d(1.5, 1.5, -2), Gf.Vec3d(0, -2, 1)]

    def flat():
        for i, place in enumerate(places):
            add(stage, UsdGeom.Sphere, path=f"/flat{i}/shape").AddTranslateOp().Set(place)

    def native():
        add(stage, UsdGeom.Sphere, path="/prototype/shape")
        stage.GetPrimAtPath("/prototype").SetSpecifier(Sdf.SpecifierClass)
        for i, place in enumerate(places):
            instance = UsdGeom.Xform.Define(stage, f"/native{i}")
            instance.AddTranslateOp().Set(place)
            instance.GetPrim().GetReferences().AddInternalReference("/prototype")
            instance.GetPrim().SetInstanceable(True)

    def points():
        instancer = UsdGeom.PointInstancer.Define(stage, "/points")
        prototype = add(stage, UsdGeom.Sphere, path="/points/shape")
        instancer.CreatePrototypesRel().SetTargets([prototype.GetPath()])
        instancer.CreateProtoIndicesAttr([0, 0, 0])
        instancer.CreatePositionsAttr([Gf.Vec3f(place) for place in places])

    images = []
    for author in (flat, native, points):
        stage = new_stage()
        add_camera(stage)
        author()
        images.append(
            estimate(
                [render(stage, shading_rate=0.25, seed=i, samples=64)["color"] for i in range(4)]
            )
        )
        assert render(stage, samples=1).warnings == []
    for image in images[1:]:
        same, figures = agree(image, images[0])
        assert same, figures


def test_a_furnace_of_normals(stage):
    """Over an orthographic view, |n.z| of a convex shape weights its area to the outline's."""
    camera = UsdGeom.Camera.Get(stage, "/camera")
    camera.CreateProjectionAttr("orthographic")
    camera.CreateHorizontalApertureAttr(VIEW * 10)
    camera.CreateVerticalApertureAttr(VIEW * 10)
    add(stage, UsdGeom.Sphere, radius=2.0)
    image = render(stage, aovs=AOVS, samples=64, shading_rate=0.25)
    # The mean of the normal over the disc, in closed form: 2/3 along z, none across.
    weighted = image["normal"] * image.alpha[..., None]
    total = weighted.reshape(-1, 3).sum(axis=0) / image.alpha.sum()
    np.testing.assert_allclose(total, [0, 0, 2 / 3], atol=0.01)
