"""Blur of curves and points: renders over a shutter are means of renders at single times.

Both are diced finely: outlines that are a tenth of a pixel off, each in its way, would show.
"""

import numpy as np
import pytest
from oracle import agree, blurred, mean_over_times
from pxr import Gf, UsdGeom
from scenes import add_camera, new_stage, render, set_samples
from strands import ZIGZAG, add_curves, add_points, normals, vectors

FINE = 0.25

STRAND = np.array(ZIGZAG) * [1, 1, 2]


def bent(points, amount):
    """Points that lean and turn."""
    points = np.asarray(points, dtype=float)
    angle = amount * (0.4 + 0.1 * points[:, 0])
    x, y = points[:, 0], points[:, 1]
    turned = np.stack(
        [x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)]
    )
    return np.column_stack([*turned, points[:, 2] + amount * x])


def deforming(form_widths, author_normals=False):
    stage = new_stage()
    add_camera(stage)
    curves = add_curves(stage, "/c", STRAND, basis="catmullRom", wrap="pinned", widths=form_widths)
    set_samples(curves.GetPointsAttr(), {0: vectors(STRAND), 1: vectors(bent(STRAND, 1))})
    if author_normals:
        normals(curves, [(0, 0.6, 0.8)], "constant")
    return stage


@pytest.mark.parametrize("form", ["ribbons", "tubes"])
@pytest.mark.parametrize("width", [0.1, 0.6])
def test_deforming_curves(form, width):
    stage = deforming(width)
    good, text = agree(
        blurred(stage, shutter=(0, 1), curves=form, shading_rate=FINE),
        mean_over_times(stage, curves=form, shading_rate=FINE),
    )
    assert good, text


def test_deforming_flat_ribbons():
    stage = deforming(0.6, author_normals=True)
    good, text = agree(
        blurred(stage, shutter=(0, 1), shading_rate=FINE), mean_over_times(stage, shading_rate=FINE)
    )
    assert good, text


@pytest.mark.parametrize("form", ["ribbons", "tubes"])
def test_turning_and_growing_curves(form):
    stage = new_stage()
    add_camera(stage)
    curves = add_curves(stage, "/c", STRAND, basis="bspline", wrap="pinned", widths=0.5)
    spin = curves.AddRotateYOp().GetAttr()
    set_samples(spin, {0: 0.0, 1: 130.0})
    set_samples(curves.AddScaleOp().GetAttr(), {0: Gf.Vec3f(1, 1, 1), 1: Gf.Vec3f(1.5, 0.5, 1)})
    good, text = agree(
        blurred(stage, shutter=(0, 1), curves=form, shading_rate=FINE),
        mean_over_times(stage, curves=form, shading_rate=FINE),
    )
    assert good, text


@pytest.mark.parametrize("form", ["ribbons", "tubes"])
def test_a_camera_that_flies_past(form):
    stage = new_stage()
    camera = add_camera(stage)
    # Near and wide: facing turns by a third of a right angle within the shutter.
    set_samples(
        camera.AddTranslateOp(opSuffix="fly").GetAttr(),
        {0: Gf.Vec3d(-2, -1, -3), 1: Gf.Vec3d(1.5, 1, -5)},
    )
    add_curves(stage, "/c", STRAND, basis="catmullRom", wrap="pinned", widths=0.4)
    good, text = agree(
        blurred(stage, shutter=(0, 1), curves=form, shading_rate=FINE),
        mean_over_times(stage, curves=form, shading_rate=FINE),
    )
    assert good, text


def particles(widths, velocity=24.0, count=60):
    rng = np.random.default_rng(2)
    stage = new_stage()
    add_camera(stage)
    places = rng.uniform(-3, 3, (count, 3)) * [1, 1, 2]
    points = add_points(stage, "/p", places, widths=widths * rng.uniform(0.5, 1.5, count))
    points.GetPointsAttr().Set(points.GetPointsAttr().Get(), 0)
    speed = rng.normal(size=(count, 3)) * velocity
    points.CreateVelocitiesAttr().Set(vectors(speed), 0)
    return stage, points


@pytest.mark.parametrize("width", [0.1, 0.6, 2.5])
def test_particles_with_velocities(width):
    stage, _ = particles(width)
    good, text = agree(
        blurred(stage, shutter=(0, 1), shading_rate=FINE), mean_over_times(stage, shading_rate=FINE)
    )
    assert good, text


def test_particles_that_accelerate_in_a_turning_frame():
    stage, points = particles(0.5)
    rng = np.random.default_rng(4)
    points.CreateAccelerationsAttr().Set(vectors(rng.normal(size=(60, 3)) * 24**2 * 2), 0)
    set_samples(points.AddRotateZOp().GetAttr(), {0: 0.0, 1: 60.0})
    good, text = agree(
        blurred(stage, shutter=(0, 1), shading_rate=FINE), mean_over_times(stage, shading_rate=FINE)
    )
    assert good, text


def test_a_camera_that_flies_through_particles():
    stage, _ = particles(0.8, velocity=0.0)
    camera = UsdGeom.Camera.Get(stage, "/camera")
    set_samples(
        camera.AddTranslateOp(opSuffix="fly").GetAttr(),
        {0: Gf.Vec3d(-2, 0, 0), 1: Gf.Vec3d(2, 1, -3)},
    )
    good, text = agree(
        blurred(stage, shutter=(0, 1), shading_rate=FINE), mean_over_times(stage, shading_rate=FINE)
    )
    assert good, text


def test_particles_that_are_born_in_mid_shutter_do_not_stop_the_others():
    stage, points = particles(0.5)
    more = np.vstack([np.asarray(points.GetPointsAttr().Get(0)), [[0, 0, 0]]])
    points.GetPointsAttr().Set(vectors(more), 1)
    points.GetVelocitiesAttr().Set(vectors(np.zeros((61, 3))), 1)
    image = render(stage, shutter=(0, 1), samples=64, aovs=("color", "elementId", "motionVectors"))
    assert image.warnings == []
    assert 60 not in image["elementId"], "it is not born yet at the frame"
    speed = np.abs(image["motionVectors"]).max(axis=-1)
    assert np.median(speed[image.alpha > 0.5]) > 1, "they move"
