"""Time samples that block a value: it holds up to the block, and has none at it."""

import hdtrapeze
import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom
from scenes import (
    add_camera,
    add_quad,
    new_stage,
    one_warning,
    quad_coverage,
    quad_points,
    render,
    set_samples,
)

BLOCK = Sdf.ValueBlock()

CAMERA = {
    "focalLength": (20.0, "50 is used"),
    "horizontalAperture": (20.0, "20.955 is used"),
    "verticalApertureOffset": (1.0, "0 is used"),
    "focusDistance": (5.0, "0 is used"),
    "fStop": (8.0, "0 is used"),
    "clippingRange": (Gf.Vec2f(1, 50), "(1, 1000000) is used"),
    "shutter:open": (-0.25, "0 is used"),
    "shutter:close": (0.25, "0 is used"),
    "exposure": (1.0, "0 is used"),
    "exposure:iso": (200.0, "100 is used"),
}


def camera_at(stage, frame, **options):
    """The camera as read at a frame, and the warnings."""
    with hdtrapeze.Renderer(width=8, camera="/camera", **options) as renderer:
        renderer.load(stage, frame)
        return renderer.camera, renderer.log.warnings


@pytest.mark.parametrize("name", CAMERA)
def test_a_blocked_attribute_of_a_camera_is_its_fallback(name):
    value, used = CAMERA[name]
    stage = new_stage()
    camera = add_camera(stage, clippingRange=Gf.Vec2f(1, 1000000))
    set_samples(camera.GetPrim().GetAttribute(name), {1: value, 2: BLOCK, 4: value})
    add_quad(stage)
    assert camera_at(stage, 1)[1] == []
    _, warnings = camera_at(stage, 3)
    text = f"{name} is blocked by a time sample; {used}"
    assert warnings == [("/camera", "type", text)]


@pytest.mark.parametrize("exposure", ["exposure", "exposure:iso"])
def test_a_lens_holds_up_to_a_block_within_the_shutter(exposure):
    stage = new_stage()
    camera = add_camera(stage)
    prim = camera.GetPrim()
    samples = {0: 10.0, 1: 20.0, 1.25: BLOCK, 1.5: 90.0}
    set_samples(prim.GetAttribute("focalLength"), samples)
    set_samples(prim.GetAttribute(exposure), {0: 1.0, 1: 2.0, 1.25: BLOCK, 1.5: 5.0})
    add_quad(stage)
    state, warnings = camera_at(stage, 0.5, shutter=(0.0, 1.5))
    assert warnings == []
    lengths = {time + 0.5: 10.0 * lens["focal_length"] for time, lens in state.lens_samples}
    assert lengths[1.0] == lengths[1.25] == lengths[1.5] == 20.0
    scales = {time + 0.5: lens["exposure_scale"] for time, lens in state.lens_samples}
    assert scales[1.0] == scales[1.25] == scales[1.5] > scales[min(scales)]


def test_a_lens_after_a_block_holds_back_to_it():
    stage = new_stage()
    camera = add_camera(stage)
    set_samples(camera.GetFocalLengthAttr(), {0: 90.0, 0.5: BLOCK, 1: 20.0, 2: 30.0})
    add_quad(stage)
    state, warnings = camera_at(stage, 1, shutter=(-0.75, 0.5))
    assert warnings == []
    assert state.focal_length == 2.0
    assert {lens["focal_length"] for time, lens in state.lens_samples if time <= 0.0} == {2.0}


SIZES = {
    UsdGeom.Cube: ("size", 2.0),
    UsdGeom.Sphere: ("radius", 1.0),
    UsdGeom.Plane: ("width", 2.0),
    UsdGeom.Cone: ("height", 2.0),
}


@pytest.mark.parametrize("schema", SIZES, ids=lambda schema: schema.__name__)
def test_a_blocked_size_is_the_schemas(schema):
    name, fallback = SIZES[schema]

    def alpha(value, frame=3, **options):
        stage = new_stage()
        add_camera(stage)
        shape = schema.Define(stage, "/shape")
        set_samples(shape.GetPrim().GetAttribute(name), value)
        return render(stage, frame, **options)

    blocked, plain = alpha({1: 4.0, 2: BLOCK, 4: 1.0}), alpha({1: fallback})
    one_warning(blocked, "/shape", f"{name} is blocked by a time sample; {fallback:g} is used")
    assert np.array_equal(blocked.alpha, plain.alpha)
    held = alpha({0: 3.0, 2: BLOCK, 4: 1.0}, frame=1, shutter=(0.0, 3.0))
    assert held.warnings == []
    assert np.array_equal(held.alpha, alpha({0: 3.0}, frame=1, shutter=(0.0, 3.0)).alpha)


LEFT, RIGHT = (-3, -1, -1, 1), (1, -1, 3, 1)
OPEN = {"shutter": (-0.5, 0.5)}


def moving_quad(samples, velocities=None):
    stage = new_stage()
    add_camera(stage)
    quad = add_quad(stage)
    set_samples(quad.GetPointsAttr(), samples)
    if velocities is not None:
        set_samples(quad.GetVelocitiesAttr(), dict.fromkeys(samples, velocities))
    return stage


def corners(*box):
    return [Gf.Vec3f(*point) for point in quad_points(*box)]


UNUSABLE = {"empty": [], "blocked": BLOCK, "few": corners(*LEFT)[:3]}


@pytest.mark.parametrize("velocities", [None, [Gf.Vec3f(0)] * 4], ids=["alone", "velocities"])
@pytest.mark.parametrize("points", UNUSABLE.values(), ids=UNUSABLE)
def test_points_that_the_frame_lacks_are_not_another_frames(points, velocities):
    stage = moving_quad({0: corners(*LEFT), 1: points, 2: corners(*LEFT)}, velocities)
    closed, opened = render(stage, 1.0), render(stage, 1.0, **OPEN)
    assert not closed.alpha.any()
    assert not opened.alpha.any()
    if velocities is None:
        assert opened.warnings == closed.warnings
        one_warning(opened, "/quad", "points")
    assert not any("differ in length" in text for _, _, text in opened.warnings)


@pytest.mark.parametrize("points", UNUSABLE.values(), ids=UNUSABLE)
def test_samples_beside_the_frame_that_cannot_be_joined(points):
    stage = moving_quad({0: points, 1: corners(*LEFT), 2: points})
    image = render(stage, 1.0, **OPEN)
    assert np.array_equal(image.alpha, quad_coverage(*LEFT))
    if points is BLOCK:
        assert image.warnings == []
    else:
        one_warning(image, "/quad", "number of points changes within the shutter")


def test_points_move_up_to_a_block():
    samples = {0: corners(*LEFT), 1: corners(*RIGHT)}
    blocked = moving_quad(samples | {1.25: BLOCK, 1.5: corners(*LEFT)})
    image = render(blocked, 0.5, shutter=(0, 2))
    assert image.warnings == []
    assert np.array_equal(image.alpha, render(moving_quad(samples), 0.5, shutter=(0, 2)).alpha)


# Instancers ---------------------------------------------------------------------------------------


def instancer(**samples):
    """Three instances of a small quad; other attributes by name, with a dict of samples."""
    stage = new_stage()
    add_camera(stage)
    made = UsdGeom.PointInstancer.Define(stage, "/many")
    add_quad(stage, "/many/quad", -0.5, -0.5, 0.5, 0.5)
    made.CreatePrototypesRel().AddTarget("/many/quad")
    made.CreateProtoIndicesAttr([0, 0, 0])
    made.CreatePositionsAttr([(-2, 0, 0), (0, 0, 0), (2, 0, 0)])
    for name, values in samples.items():
        set_samples(made.GetPrim().GetAttribute(name), values)
    return stage


@pytest.mark.parametrize("options", [{}, OPEN], ids=["closed", "open"])
def test_instances_without_positions_are_not_rendered(options):
    image = render(instancer(positions={0: []}), **options)
    one_warning(image, "/many", "0 positions for 3 instances; they are not rendered")
    assert not image.alpha.any()
    image = render(instancer(positions={0: [(0, 0, 0)] * 3, 1: [], 2: []}), 1.0, **OPEN)
    one_warning(image, "/many", "0 positions for 3 instances; they are not rendered")


def test_blocked_scales_hold_up_to_the_block():
    scales = {0: [(1, 1, 1)] * 3, 1: [(2, 2, 2)] * 3}
    blocked = instancer(scales=scales | {1.25: BLOCK, 2: [(9, 9, 9)] * 3})
    image = render(blocked, 0.5, shutter=(0, 2))
    assert image.warnings == []
    plain = render(instancer(scales=scales), 0.5, shutter=(0, 2))
    assert np.array_equal(image.alpha, plain.alpha)
    at_block = render(blocked, 1.5, **OPEN)
    assert at_block.warnings == []
    assert np.array_equal(at_block.alpha, render(instancer()).alpha)


def test_ids_of_another_number_are_named():
    stage = instancer(ids={0: [5, 6]}, invisibleIds={0: [1]})
    image = render(stage)
    one_warning(image, "/many", "2 ids for 3 instances; its instances are known by their numbers")
    expected = quad_coverage(-2.5, -0.5, -1.5, 0.5) + quad_coverage(1.5, -0.5, 2.5, 0.5)
    assert np.array_equal(image.alpha, expected)
