"""Time samples that block a value: it holds up to the block, and has none at it."""

import hdtrapeze
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom
from scenes import add_camera, add_quad, new_stage, one_warning, render, set_samples

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
