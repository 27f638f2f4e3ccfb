"""Apertures, shutter curves, lenses that change and clipping planes, as stages author them."""

import hdtrapeze
import numpy as np
import pytest
from oracle import agree, blurred, mean_over_times
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from scenes import (
    DISTANCE,
    add_camera,
    add_quad,
    new_stage,
    one_warning,
    quad_coverage,
    render,
    set_samples,
)

NAMES = Sdf.ValueTypeNames


def author(camera, **attributes):
    """Attributes by name, with __ for colons; types as pipelines author them."""
    kinds = {int: NAMES.Int, float: NAMES.Float, str: NAMES.Token}
    for name, value in attributes.items():
        kind = kinds.get(type(value))
        if kind is None:
            kind = NAMES.Float2Array if np.ndim(value) == 2 else NAMES.FloatArray
            value = [Gf.Vec2f(*v) for v in value] if np.ndim(value) == 2 else list(value)
        camera.GetPrim().CreateAttribute(name.replace("__", ":"), kind).Set(value)


LENS = 5.0
"""Radius of the round lens, units."""
LIGHT = 2.5
"""Half the side of the light, units."""


def bokeh(z=-10.0, **attributes):
    """Alpha of a square light, out of focus by the whole lens' size at z = -10."""
    stage = new_stage()
    # In focus at z = 0, where the view is 10 x 10 units.
    camera = add_camera(stage, fStop=2.0 / (2 * LENS), focusDistance=DISTANCE)
    author(camera, **attributes)
    add_quad(stage, "/light", -LIGHT, -LIGHT, LIGHT, LIGHT, z=z)
    image = render(stage, samples=256)
    assert image.warnings == []
    return image.alpha


def is_open(x, y, blades=0, rotation=0.0, ratio=1.0, roundness=0.0):
    """Which points of the lens are in the opening: an intersection of half planes or disks."""
    x, y = x / LENS / np.sqrt(ratio), y / LENS * np.sqrt(ratio)
    if blades < 3 or roundness == 1.0:
        return x * x + y * y <= 1.0
    half = np.pi / blades
    area = blades * np.sin(half) * np.cos(half)
    if roundness:
        arc = np.arcsin(np.sin(half) * roundness)
        area += blades * (arc - np.sin(arc) * np.cos(arc)) / roundness**2
    size = np.sqrt(np.pi / area)
    found = np.ones(np.broadcast(x, y).shape, dtype=bool)
    for k in range(blades):
        turn = np.pi / 2 + np.radians(rotation) + half * (2 * k + 1)
        along = (x * np.cos(turn) + y * np.sin(turn)) / size
        across = (y * np.cos(turn) - x * np.sin(turn)) / size
        if roundness:
            centre = np.cos(half) - np.cos(arc) / roundness
            found &= (along - centre) ** 2 + across**2 <= roundness**-2
        else:
            found &= along <= np.cos(half)
    return found


def expected_bokeh(z=-10.0, **aperture):
    """The share of the opening that sees the light, at each pixel's centre."""
    fine = np.linspace(-2 * LENS, 2 * LENS, 321)
    lens_x, lens_y = np.meshgrid(fine, fine)
    inside = is_open(lens_x, lens_y, **aperture)
    lens_x, lens_y = lens_x[inside], lens_y[inside]
    depth = (DISTANCE - z) / DISTANCE
    centres = (np.arange(40) + 0.5) / 4 - 5
    alpha = np.empty((40, 40))
    for row, y in enumerate(-centres):
        in_rows = np.abs(lens_y * (1 - depth) + y * depth) < LIGHT
        at = lens_x[in_rows] * (1 - depth)
        for column, x in enumerate(centres):
            alpha[row, column] = np.count_nonzero(np.abs(at + x * depth) < LIGHT) / inside.sum()
    return alpha


def off(a, b):
    return float(np.sqrt(np.mean((a - b) ** 2)))


APERTURES = [
    {"blades": 5},
    {"blades": 5, "rotation": 20.0},
    {"blades": 6, "rotation": 15.0, "ratio": 2.0},
    {"blades": 3, "rotation": -100.0, "ratio": 0.5, "roundness": 0.4},
    {"ratio": 0.5},
]


@pytest.mark.parametrize("aperture", APERTURES)
@pytest.mark.parametrize("z", [-10.0, 4.0])
def test_out_of_focus_lights_have_the_openings_shape(aperture, z):
    alpha = bokeh(z, **{f"trapeze__aperture__{name}": value for name, value in aperture.items()})
    right = off(alpha, expected_bokeh(z, **aperture))
    assert right < 0.01
    # Neither upside down nor round nor twice as wide.
    upright = (aperture.get("blades", 0) % 2) == 0
    assert upright or off(alpha[::-1, ::-1], expected_bokeh(z, **aperture)) > 1.5 * right
    assert off(alpha, expected_bokeh(z)) > 1.15 * right
    wide = aperture | {"ratio": 2 * aperture.get("ratio", 1.0)}
    assert off(alpha, expected_bokeh(z, **wide)) > 1.5 * right


def test_a_round_opening_is_what_it_was():
    plain = bokeh()
    for attributes in (
        {"trapeze__aperture__blades": 2},
        {"trapeze__aperture__rotation": 30.0},
        {"trapeze__aperture__blades": 7, "trapeze__aperture__roundness": 1.0},
    ):
        np.testing.assert_array_equal(bokeh(**attributes), plain)
    assert off(plain, expected_bokeh()) < 0.01


def test_names_of_other_renderers():
    ours = bokeh(
        trapeze__aperture__blades=5,
        trapeze__aperture__rotation=20.0,
        trapeze__aperture__roundness=0.25,
    )
    rendermans = {"ri__apertureNSides": 5, "ri__apertureAngle": 20.0}
    arnolds = {
        "primvars__arnold__aperture_blades": 5,
        "primvars__arnold__aperture_rotation": 20.0,
        "primvars__arnold__aperture_blade_curvature": 0.25,
    }
    np.testing.assert_array_equal(bokeh(ri__apertureRoundness=0.25, **rendermans), ours)
    np.testing.assert_array_equal(bokeh(**arnolds), ours)
    # RenderMan's roundness is 1 where nothing is authored.
    np.testing.assert_array_equal(bokeh(**rendermans), bokeh())
    # Ours go before RenderMan's, those before Arnold's.
    other = dict.fromkeys(arnolds, 0.5) | {"primvars__arnold__aperture_blades": 3}
    both = bokeh(ri__apertureRoundness=0.25, **(rendermans | other))
    np.testing.assert_array_equal(both, ours)
    mixed = bokeh(trapeze__aperture__rotation=20.0, **(arnolds | {"ri__apertureAngle": 3.0}))
    np.testing.assert_array_equal(mixed, ours)


# Shutter curves ----------------------------------------------------------------------------------


def trail(**attributes):
    """Alpha of a bar that crosses the image during the shutter: its profile is the openness."""
    stage = new_stage()
    camera = add_camera(stage, shutter__open=0.0, shutter__close=1.0)
    author(camera, **attributes)
    bar = add_quad(stage, "/bar", -4.25, -4, -3.75, 4)
    set_samples(bar.AddTranslateOp().GetAttr(), {0: Gf.Vec3d(0), 1: Gf.Vec3d(8, 0, 0)})
    image = render(stage, samples=256)
    assert image.warnings == []
    return image.alpha


def mean_place(alpha):
    """Mean x, units."""
    x = (np.arange(40) + 0.5) / 4 - 5
    return float((alpha.sum(axis=0) @ x) / alpha.sum())


CURVES = {
    "ramp": ({"trapeze__shutter__curve": [(0, 0), (1, 1)]}, 2 / 3),
    "trapezoid": (
        {"trapeze__shutter__curve": [(0, 0), (0.25, 1), (0.5, 1), (1, 0)]},
        (0.125 / 6 + 0.25 * 0.375 + 0.25 * 2 / 3) / 0.625,
    ),
    "first half": ({"trapeze__shutter__curve": [(0.5, 1), (0.5, 0)]}, 0.25),
    "RenderMan's": (
        {"ri__shutterOpenTime": 0.25, "ri__shutterCloseTime": 0.5},
        (0.125 / 6 + 0.25 * 0.375 + 0.25 * 2 / 3) / 0.625,
    ),
    # Control points at thirds of straight ramps: the ramps themselves.
    "RenderMan's points": (
        {
            "ri__shutterOpenTime": 0.3,
            "ri__shutterCloseTime": 0.4,
            "ri__shutteropening": [0.1, 1 / 3, 0.2, 2 / 3, 0.6, 2 / 3, 0.8, 1 / 3],
        },
        (0.15 * 0.2 + 0.1 * 0.35 + 0.3 * 0.6) / 0.55,
    ),
    "Arnold's triangle": ({"primvars__arnold__shutter_type": "triangle"}, 0.5),
    "Arnold's curve": (
        {
            "primvars__arnold__shutter_type": "curve",
            "primvars__arnold__shutter_curve": [(0, 1), (1, 0)],
        },
        1 / 3,
    ),
    "ours first": (
        {"trapeze__shutter__curve": [(0, 0), (1, 1)], "ri__shutterCloseTime": 0.1},
        2 / 3,
    ),
}


@pytest.mark.parametrize("name", CURVES)
def test_shutter_curves_weigh_instants(name):
    attributes, mean = CURVES[name]
    alpha = trail(**attributes)
    assert mean_place(alpha) == pytest.approx(-4 + 8 * mean, abs=0.02)
    # As bright as ever: the bar is somewhere at each instant.
    assert alpha.sum() == pytest.approx(0.5 * 8 * 16, rel=0.005)


def test_the_profile_of_a_triangle():
    alpha = trail(primvars__arnold__shutter_type="triangle")
    profile = alpha[8:32].mean(axis=0)
    x = (np.arange(40) + 0.5) / 4 - 5
    # Half a unit of 8 passes in a 16th of the shutter; openness is 2 in its middle.
    expected = np.clip(1 - np.abs(x) / 4, 0, None) * 2 / 16
    np.testing.assert_allclose(profile, expected, atol=0.012)


def test_even_shutters_have_the_bits_of_none():
    plain = trail()
    for curve in ([(0, 1), (1, 1)], [(0.3, 0.5)]):
        np.testing.assert_array_equal(trail(trapeze__shutter__curve=curve), plain)
    np.testing.assert_array_equal(trail(primvars__arnold__shutter_type="box"), plain)


# Lenses that change ------------------------------------------------------------------------------


def changing_stage(interpolation=None, **samples):
    stage = new_stage()
    if interpolation:
        stage.SetInterpolationType(interpolation)
    camera = add_camera(stage, fStop=1.0, focusDistance=9.0)
    for name, values in samples.items():
        set_samples(camera.GetPrim().GetAttribute(name.replace("__", ":")), values)
    add_quad(stage, "/near", -3, -2, 0, 1, z=1.0)
    add_quad(stage, "/far", -1, -3, 4, 3, z=-5.0, color=(0.2, 0.4, 0.9))
    return stage


CHANGES = {
    "rack focus": {
        "focusDistance": {-1: 8.0, 0.5: 8.0, 0.75: 16.0, 3: 16.0},
        "fStop": {0: 1.0, 0.4: 4.0, 1: 2.0},
    },
    "zoom": {
        "focalLength": {0: 16.0, 1: 24.0},
        "horizontalAperture": {0: 16.0, 1: 30.0},
        "horizontalApertureOffset": {0: -4.0, 1: 2.0},
        "fStop": {-1: 2.0, 2: 0.5},
    },
    "flash": {"exposure": {0: 0.0, 0.5: 2.0, 1: -1.0}, "focusDistance": {0: 8.0, 1: 12.0}},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_changing_lens_is_the_mean_of_lenses_that_stay(name):
    stage = changing_stage(**CHANGES[name])
    moving = blurred(stage, shutter=(0, 1), samples=256)
    good, figures = agree(moving, mean_over_times(stage, samples=16))
    assert good, figures
    # And is no lens that stays.
    good, figures = agree(moving, blurred(stage, shutter=(0, 0), samples=256))
    assert not good, figures


def test_a_change_is_explained_and_costs_nothing_where_there_is_none():
    from hdtrapeze import Options, Renderer

    def explained(stage):
        with Renderer(Options(width=40, height=40, camera="/camera", shutter=(0, 1))) as renderer:
            renderer.load(stage, 0.0)
            renderer.commit()
            return renderer.explain()

    assert "changing over the shutter" in explained(changing_stage(focusDistance={0: 8, 1: 16}))
    text = explained(changing_stage(focusDistance={0: 8, 1: 8}))
    assert "changing" not in text
    assert "time: still" in text


def test_a_held_stage_and_no_motion_blur_keep_the_lens():
    plain = render(changing_stage(focusDistance={0: 8.0}), samples=16)["color"]
    rack = {0: 8.0, 1: 16.0}
    held = changing_stage(Usd.InterpolationTypeHeld, focusDistance=rack)
    image = render(held, shutter=(0, 0.9), samples=16)["color"]
    np.testing.assert_array_equal(image, plain)
    stage = changing_stage(focusDistance=rack)
    image = render(stage, shutter=(0, 1), samples=16, motion_blur=False)["color"]
    np.testing.assert_array_equal(image, plain)


def test_a_ramp_of_exposure_is_as_exact_as_a_gentle_one():
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage, "/all", -9, -9, 9, 9)
    plain = render(stage)["color"][20, 20, 0]
    set_samples(camera.GetExposureAttr(), {-2: -20.0, 2: 20.0})
    mean = render(stage, shutter=(-0.5, 0.5), samples=4096)["color"][20, 20, 0]
    # The mean of 2^x over -5 to 5.
    assert mean / plain == pytest.approx((2**5 - 2**-5) / (10 * np.log(2)), rel=0.004)


def test_towards_a_pinhole_the_radius_goes_linearly():
    def f_stop(frame, **options):
        stage = changing_stage(fStop={0: 0.0, 4: 2.0})
        with hdtrapeze.Renderer(width=40, camera="/camera", **options) as renderer:
            renderer.load(stage, frame)
            return renderer.camera.f_stop

    assert f_stop(0) == 0.0
    assert f_stop(4) == 2.0
    assert f_stop(1) == pytest.approx(8.0)
    # The same where the shutter is open: a frame's lens does not depend on it.
    still = changing_stage(fStop={0: 8.0})
    near = changing_stage(fStop={-1: 0.0, 7: 1.0})
    image = blurred(near, shutter=(-0.01, 0.01), samples=64)
    good, figures = agree(image, blurred(still, shutter=(0, 0), samples=64))
    assert good, figures


def test_the_image_has_the_size_of_the_frames_own_film():
    stage = new_stage()
    camera = add_camera(stage)
    set_samples(camera.GetVerticalApertureAttr(), {0: 20.0, 1: 10.0, 2: 5.0})
    sizes = set()
    for shutter in ((0, 0), (-1, 1), (0, 1), (-1, -0.5)):
        with hdtrapeze.Renderer(width=40, camera="/camera", shutter=shutter) as renderer:
            renderer.load(stage, 1)
            sizes.add(renderer.resolution)
    assert sizes == {(40, 20)}


def test_a_film_back_of_no_use_is_the_default_one_in_shape_too():
    stage = new_stage()
    add_camera(stage, horizontalAperture=1e30)
    with hdtrapeze.Renderer(width=160, camera="/camera") as renderer:
        renderer.load(stage, 0)
        assert renderer.resolution == (160, 116)


def test_zoom_dices_for_its_longest_end():
    stage = new_stage()
    camera = add_camera(stage)
    points = Vt.Vec3fArray([Gf.Vec3f(*p) for p in ((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))])
    mesh = UsdGeom.Mesh.Define(stage, "/mesh")
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    counts = []
    for samples in ({0: 20.0}, {0: 60.0}, {0: 20.0, 0.5: 60.0, 1: 20.0}):
        camera.GetFocalLengthAttr().Clear()
        set_samples(camera.GetFocalLengthAttr(), samples)
        counts.append(render(stage, shutter=(0, 1)).statistics["micropolygons"])
    short, long, zoom = counts
    assert long > 4 * short
    assert zoom == long


# Exposure ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("attributes", "scale"),
    [
        ({"exposure": 1.5}, 2**1.5),
        ({"exposure:iso": 400.0}, 4.0),
        ({"exposure:time": 0.25}, 0.25),
        ({"exposure:fStop": 2.0}, 0.25),
        ({"exposure:responsivity": 3.0}, 3.0),
        (
            {
                "exposure": -1.0,
                "exposure:iso": 200.0,
                "exposure:time": 0.5,
                "exposure:fStop": 0.5,
                "exposure:responsivity": 0.25,
            },
            0.5,
        ),
    ],
)
def test_every_exposure_attribute_counts(attributes, scale):
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage)
    plain = render(stage)["color"]
    for name, value in attributes.items():
        camera.GetPrim().GetAttribute(name).Set(value)
    image = render(stage)
    assert image.warnings == []
    np.testing.assert_allclose(image["color"][..., :3], scale * plain[..., :3], rtol=1e-5)
    np.testing.assert_array_equal(image.alpha, plain[..., 3])


@pytest.mark.parametrize(("name", "value"), [("fStop", 0.0), ("time", -1.0), ("iso", float("nan"))])
def test_exposures_that_cannot_be(name, value):
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage)
    plain = render(stage)["color"]
    camera.GetPrim().GetAttribute(f"exposure:{name}").Set(value)
    image = render(stage)
    assert [w[0] for w in image.warnings] == ["/camera"]
    assert "exposure" in image.warnings[0][2]
    np.testing.assert_array_equal(image["color"], plain)


def test_the_lenss_own_f_stop_is_no_exposure():
    stage = new_stage()
    camera = add_camera(stage, focusDistance=DISTANCE)
    add_quad(stage)
    plain = render(stage, samples=16)["color"]
    camera.GetFStopAttr().Set(1.0)
    np.testing.assert_allclose(render(stage, samples=16)["color"], plain, atol=2e-3)


# Clipping planes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_clipping_planes_cut_in_camera_space(projection):
    stage = new_stage()
    camera = add_camera(stage, projection=projection)
    if projection == "orthographic":
        for name in ("horizontalAperture", "verticalAperture"):
            camera.GetPrim().GetAttribute(name).Set(100.0)
    add_quad(stage)
    # The quad is at z = 0, 10 before the camera. Keep x >= -1, and y <= 0.5.
    planes = [(1, 0, 0, 1), (0, -2, 0, 1)]
    camera.CreateClippingPlanesAttr([Gf.Vec4f(*p) for p in planes])
    np.testing.assert_array_equal(render(stage).alpha, quad_coverage(-1, -2, 2, 0.5))
    # Behind depth 11 nothing is cut off; up to there all is.
    for depth, kept in ((9, 1.0), (11, 0.0)):
        camera.CreateClippingPlanesAttr([Gf.Vec4f(0, 0, -1, -depth)])
        np.testing.assert_array_equal(render(stage).alpha, kept * quad_coverage(-2, -2, 2, 2))
    # The camera carries its planes.
    UsdGeom.Xformable(camera).AddRotateZOp().Set(90)
    camera.CreateClippingPlanesAttr([Gf.Vec4f(1, 0, 0, 0)])
    np.testing.assert_allclose(render(stage).alpha, quad_coverage(0, -2, 2, 2), atol=1e-6)


def test_what_a_plane_opens_shows_what_is_behind():
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage, "/front", z=2.0)
    back = add_quad(stage, "/back", -1, -1, 1, 1, color=(1, 0, 0))
    camera.CreateClippingPlanesAttr([Gf.Vec4f(0, 0, -1, -9)])
    stage.GetPrimAtPath("/front").SetActive(False)
    alone = render(stage, aovs=("color", "cameraDepth"))
    stage.GetPrimAtPath("/front").SetActive(True)
    cut = render(stage, aovs=("color", "cameraDepth"))
    np.testing.assert_array_equal(cut["color"], alone["color"])
    np.testing.assert_array_equal(cut["cameraDepth"], alone["cameraDepth"])
    assert back


def test_a_stereo_role_changes_nothing():
    stage = new_stage()
    camera = add_camera(stage)
    add_quad(stage)
    plain = render(stage)["color"]
    camera.GetStereoRoleAttr().Set("right")
    image = render(stage)
    assert image.warnings == []
    np.testing.assert_array_equal(image["color"], plain)


def test_attributes_that_are_none_of_a_cameras():
    stage = new_stage()
    author(add_camera(stage), trapeze__aperture__blade=5)
    add_quad(stage)
    one_warning(render(stage), "/camera", "blade is no attribute", "trapeze:aperture:blades?")


def test_numbers_in_warnings_are_short_and_as_authored():
    stage = new_stage()
    add_camera(stage, horizontalAperture=1e30)
    add_quad(stage)
    one_warning(render(stage), "/camera", "apertures 1e30 x 20 with focal length 20 (tenths")
